# The CUDA engine is built where there is an nvcc; nothing else of the toolkit is asked for. One object file, made
# by a command of its own: no relocatable device code, no second language for the programs that link it.
#   STILLMAP_CUDA                AUTO, ON (an error without nvcc), OFF
#   STILLMAP_NVCC                the compiler, where it is not found by itself
#   STILLMAP_CUDA_ARCHITECTURES  e.g. 87 on an Orin board, for a faster build
set(STILLMAP_CUDA AUTO CACHE STRING "the CUDA engine: AUTO (where nvcc is found), ON, OFF")
set(STILLMAP_CUDA_FOUND OFF)
set(STILLMAP_CUDA_SUMMARY "left out: cuda (STILLMAP_CUDA=OFF)")

if(STILLMAP_SANITIZE AND STILLMAP_CUDA STREQUAL AUTO)
  set(STILLMAP_CUDA_SUMMARY "left out: cuda (sanitizers)")
elseif(NOT STILLMAP_CUDA STREQUAL OFF)
  find_program(STILLMAP_NVCC nvcc HINTS ENV CUDA_HOME ENV CUDA_PATH PATH_SUFFIXES bin PATHS /usr/local/cuda/bin)
  if(STILLMAP_NVCC)
    execute_process(COMMAND ${STILLMAP_NVCC} --version OUTPUT_VARIABLE about ERROR_QUIET)
    string(REGEX MATCH "release ([0-9]+\\.[0-9]+)" _ "${about}")
    set(version "${CMAKE_MATCH_1}")
  endif()
  if(NOT STILLMAP_NVCC)
    set(STILLMAP_CUDA_SUMMARY "left out: cuda (no nvcc)")
  elseif(version VERSION_LESS 12.2)
    set(STILLMAP_CUDA_SUMMARY "left out: cuda (nvcc ${version}, 12.2 is needed)")
  else()
    get_filename_component(nvcc_dir "${STILLMAP_NVCC}" REALPATH)
    get_filename_component(nvcc_dir "${nvcc_dir}" DIRECTORY)
    # For another host's compiler, which nvcc does not tell by itself.
    get_filename_component(STILLMAP_CUDA_INCLUDE "${nvcc_dir}/../include" ABSOLUTE)
    find_library(STILLMAP_CUDART cudart_static HINTS ${nvcc_dir}/../lib64 ${nvcc_dir}/../lib
      ${nvcc_dir}/../targets/${CMAKE_SYSTEM_PROCESSOR}-linux/lib ${nvcc_dir}/../targets/sbsa-linux/lib)
    if(STILLMAP_CUDART)
      set(STILLMAP_CUDA_FOUND ON)
    else()
      set(STILLMAP_CUDA_SUMMARY "left out: cuda (no libcudart_static beside nvcc)")
    endif()
  endif()
  if(STILLMAP_CUDA STREQUAL ON AND NOT STILLMAP_CUDA_FOUND)
    message(FATAL_ERROR "STILLMAP_CUDA=ON, but ${STILLMAP_CUDA_SUMMARY}")
  endif()
endif()

if(STILLMAP_CUDA_FOUND)
  # Orin and data-centre GPUs; Thor since the toolkit that has it under this name.
  set(architectures 87 90)
  if(NOT version VERSION_LESS 13.0)
    list(APPEND architectures 110)
  endif()
  set(STILLMAP_CUDA_ARCHITECTURES "${architectures}" CACHE STRING "compute capabilities, without the dot")
  list(JOIN STILLMAP_CUDA_ARCHITECTURES ", " names)
  set(STILLMAP_CUDA_SUMMARY "cuda (nvcc ${version} for ${names})")
endif()

# stillmap_cuda_object(OUT SOURCE [OPTIONS...]): compiles a .cu file as C++17 for all architectures.
function(stillmap_cuda_object out source)
  foreach(architecture ${STILLMAP_CUDA_ARCHITECTURES})
    list(APPEND code -gencode arch=compute_${architecture},code=sm_${architecture})
  endforeach()
  if(CMAKE_CXX_COMPILER_LAUNCHER MATCHES ccache)
    set(launcher ${CMAKE_CXX_COMPILER_LAUNCHER})
  endif()
  # 554: a conversion of ImageView<const T> to itself, which is never called.
  add_custom_command(OUTPUT ${out}
    COMMAND ${launcher} ${STILLMAP_NVCC} -std=c++17 -O3 --threads 2 ${code} -I${CMAKE_SOURCE_DIR}
            -diag-suppress 554 --Werror all-warnings -Xcompiler -Wall,-Wextra,-Wshadow,-fPIE ${ARGN}
            -MD -MF ${out}.d -c ${source} -o ${out}
    DEPENDS ${source} DEPFILE ${out}.d
    COMMENT "Building the CUDA engine"
    VERBATIM)
endfunction()
