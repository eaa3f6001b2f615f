#pragma once
// The only file that looks at the compiler: STILLMAP_HD marks a function that both engines use.
#if defined(__CUDACC__)
#define STILLMAP_HD __host__ __device__ inline
#else
// Always inlined: the CPU engine is compiled once for each instruction set, and an out-of-line copy of an
// element function made with AVX2 must never be the one that the linker gives to a machine without it.
#define STILLMAP_HD inline __attribute__((always_inline))
#endif
