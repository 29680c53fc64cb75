// SPDX-License-Identifier: Apache-2.0
#pragma once

// Compiles a function for several instruction sets, chosen when the program starts: the packages
// are built for plain x86-64, and the inner loops of kernels gain 2 to 4 times from wider
// registers. By feature level, not by a processor's name ("haswell"): GCC takes a clone of a name
// on that very processor alone, and others ran the default. A macro because an attribute has no
// other name; nothing where the compiler or a sanitizer cannot.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define KINESCOPE_HAS_WIDE
#define KINESCOPE_WIDE __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define KINESCOPE_WIDE
#endif
