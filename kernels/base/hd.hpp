#pragma once
// The only file that looks at the compiler: STILLMAP_HD marks a function that both engines use.
#if defined(__CUDACC__)
#define STILLMAP_HD __host__ __device__ inline
/// A function that runs on a grid: on the GPU, or in the tests on the emulated one (backend/cuda/grid.hpp).
#define STILLMAP_GRID __device__ inline
/// Before a loop whose counter indexes an array that is to stay in registers.
#define STILLMAP_UNROLL _Pragma("unroll")
#else
// Always inlined: the CPU engine is compiled once for each instruction set, and an out-of-line copy of an
// element function made with AVX2 must never be the one that the linker gives to a machine without it.
#define STILLMAP_HD inline __attribute__((always_inline))
#define STILLMAP_GRID inline
#define STILLMAP_UNROLL
#endif

/// 1 where the code at hand is compiled for the GPU.
#if defined(__CUDA_ARCH__)
#define STILLMAP_ON_GPU 1
#else
#define STILLMAP_ON_GPU 0
#endif
