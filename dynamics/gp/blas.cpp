// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/blas.h"

#include <algorithm>
#include <vector>

#include <cblas.h>

#include "kinematics/core/error.h"

// OpenBLAS holds LAPACK; Debian ships its C interface in another package, so these are declared
// here.
// NOLINTBEGIN(readability-identifier-naming): the names LAPACK has.
extern "C" {
void dpotrf_(const char* uplo, const int* n, double* a, const int* lda, int* info);
void dtrtri_(const char* uplo, const char* diag, const int* n, double* a, const int* lda,
             int* info);
void dgeqrf_(const int* m, const int* n, double* a, const int* lda, double* tau, double* work,
             const int* lwork, int* info);
}
// NOLINTEND(readability-identifier-naming)

namespace kinescope::gp {
namespace {

int as_int(Eigen::Index value) {
  KINESCOPE_CHECK(value <= std::numeric_limits<int>::max(), "a matrix too large for BLAS");
  return static_cast<int>(value);
}

int stride(const ConstBlock& a) { return std::max(1, as_int(a.outerStride())); }
int stride(const Block& a) { return std::max(1, as_int(a.outerStride())); }

bool empty(const Block& a) { return a.rows() == 0 || a.cols() == 0; }

void gemm(CBLAS_TRANSPOSE ta, CBLAS_TRANSPOSE tb, Eigen::Index inner, double alpha,
          const ConstBlock& a, const ConstBlock& b, double beta, Block& c) {
  if (empty(c)) return;
  if (inner == 0) {
    c *= beta;
    return;
  }
  // OpenBLAS does not see that a product with one column is a matrix times a vector.
  if (c.cols() == 1) {
    const int step = tb == CblasTrans ? stride(b) : 1;
    cblas_dgemv(CblasColMajor, ta, as_int(a.rows()), as_int(a.cols()), alpha, a.data(), stride(a),
                b.data(), step, beta, c.data(), 1);
    return;
  }
  cblas_dgemm(CblasColMajor, ta, tb, as_int(c.rows()), as_int(c.cols()), as_int(inner), alpha,
              a.data(), stride(a), b.data(), stride(b), beta, c.data(), stride(c));
}

void trsm(CBLAS_SIDE side, CBLAS_TRANSPOSE transposed, const ConstBlock& l, Block& b) {
  if (empty(b)) return;
  if (side == CblasLeft && b.cols() == 1) {
    cblas_dtrsv(CblasColMajor, CblasLower, transposed, CblasNonUnit, as_int(l.rows()), l.data(),
                stride(l), b.data(), 1);
    return;
  }
  cblas_dtrsm(CblasColMajor, side, CblasLower, transposed, CblasNonUnit, as_int(b.rows()),
              as_int(b.cols()), 1.0, l.data(), stride(l), b.data(), stride(b));
}

}  // namespace

void product_transposed(double alpha, const ConstBlock& a, const ConstBlock& b, double beta,
                        Block c) {
  gemm(CblasNoTrans, CblasTrans, a.cols(), alpha, a, b, beta, c);
}

void product(double alpha, const ConstBlock& a, const ConstBlock& b, double beta, Block c) {
  gemm(CblasNoTrans, CblasNoTrans, a.cols(), alpha, a, b, beta, c);
}

void transposed_product(double alpha, const ConstBlock& a, const ConstBlock& b, double beta,
                        Block c) {
  gemm(CblasTrans, CblasNoTrans, a.rows(), alpha, a, b, beta, c);
}

void add_square(double alpha, const ConstBlock& a, double beta, Block c) {
  if (empty(c)) return;
  cblas_dsyrk(CblasColMajor, CblasLower, CblasNoTrans, as_int(c.rows()), as_int(a.cols()), alpha,
              a.data(), stride(a), beta, c.data(), stride(c));
}

void solve_lower(const ConstBlock& l, Block b) { trsm(CblasLeft, CblasNoTrans, l, b); }
void solve_lower_transposed(const ConstBlock& l, Block b) { trsm(CblasLeft, CblasTrans, l, b); }
void solve_lower_transposed_right(const ConstBlock& l, Block b) {
  trsm(CblasRight, CblasTrans, l, b);
}
void solve_lower_right(const ConstBlock& l, Block b) { trsm(CblasRight, CblasNoTrans, l, b); }

int cholesky(Block a) {
  if (empty(a)) return 0;
  const int n = as_int(a.rows());
  const int lda = stride(a);
  int info = 0;
  dpotrf_("L", &n, a.data(), &lda, &info);
  KINESCOPE_CHECK(info >= 0, "dpotrf was given a bad argument");
  return info;
}

void invert_lower(Block l) {
  if (empty(l)) return;
  const int n = as_int(l.rows());
  const int lda = stride(l);
  int info = 0;
  dtrtri_("L", "N", &n, l.data(), &lda, &info);
  KINESCOPE_CHECK(info == 0, "a triangle with a zero on its diagonal");
}

void upper_of_qr(Eigen::MatrixXd& a) {
  if (a.size() == 0) return;
  const int m = as_int(a.rows());
  const int n = as_int(a.cols());
  std::vector<double> tau(static_cast<std::size_t>(std::min(m, n)));
  constexpr int kPanel = 64;
  const int work_size = n * kPanel;
  std::vector<double> work(static_cast<std::size_t>(work_size));
  int info = 0;
  dgeqrf_(&m, &n, a.data(), &m, tau.data(), work.data(), &work_size, &info);
  KINESCOPE_CHECK(info == 0, "dgeqrf was given a bad argument");
  for (Eigen::Index i = 0; i < std::min(a.rows(), a.cols()); ++i) {
    if (a(i, i) < 0.0) a.row(i).tail(a.cols() - i) *= -1.0;
  }
}

std::string blas_core() { return openblas_get_corename(); }

}  // namespace kinescope::gp
