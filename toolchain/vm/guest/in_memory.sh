# Sourced by scripts in the virtual machine.
#   in_memory PROGRAM...   reads programs and their libraries into memory, so that no wait for the host's files is left
#                          in what they do afterwards (such a wait makes the guest's clock jump)
in_memory() {
  local program libraries
  for program in "$@"; do
    mapfile -t libraries < <(ldd "$program" | grep -o '/[^ ]*')
    cat "$program" "${libraries[@]}" >/dev/null
  done
}
