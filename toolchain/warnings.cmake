add_library(stillmap_warnings INTERFACE)
target_compile_options(stillmap_warnings INTERFACE
  -Wall -Wextra -Wconversion -Wshadow -Wdouble-promotion -Wnon-virtual-dtor -Werror)
