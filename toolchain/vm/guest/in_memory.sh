# Sourced by scripts in the virtual machine.
#   in_memory PROGRAM...   reads programs and their libraries into memory, so that no wait for the host's files is left
#                          in what they do afterwards (such a wait makes the guest's clock jump)
in_memory() {
  local program
  for program in "$@"; do
    cat "$program" $(ldd "$program" | grep -o '/[^ ]*') >/dev/null
  done
}
