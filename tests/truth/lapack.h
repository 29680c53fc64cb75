// SPDX-License-Identifier: Apache-2.0
//
// Bare BLAS and LAPACK to time ours beside: Fortran's, of which OpenBLAS installs no C++ header.
#pragma once

extern "C" {
void dgemm_(const char*, const char*, const int*, const int*, const int*, const double*,
            const double*, const int*, const double*, const int*, const double*, double*,
            const int*);
void dpotrf_(const char*, const int*, double*, const int*, int*);
}
