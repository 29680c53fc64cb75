// SPDX-License-Identifier: Apache-2.0
//
// The dense route over several processes: a grid of them (BLACS) holds the kernel matrix in blocks
// that go round (Blackford and others 1997, section 4.3), ScaLAPACK factors and solves.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <exception>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include "dynamics/gp/posterior.h"
#include "dynamics/gp/process_group.h"
#include "kinematics/core/error.h"

// Debian ships no header of these; BLACS starts MPI, so that none of MPI's is needed either.
extern "C" {
void Cblacs_pinfo(int* rank, int* count);
void Cblacs_get(int context, int what, int* value);
void Cblacs_gridinit(int* context, const char* order, int rows, int cols);
void Cblacs_gridinfo(int context, int* rows, int* cols, int* row, int* col);
void Cblacs_gridexit(int context);
void Cblacs_exit(int keep_mpi);
void Cdgsum2d(int context, const char* scope, const char* topology, int rows, int cols, double* a,
              int leading, int to_row, int to_col);
int numroc_(const int* n, const int* block, const int* process, const int* first,
            const int* processes);
void descinit_(int* descriptor, const int* rows, const int* cols, const int* row_block,
               const int* col_block, const int* first_row, const int* first_col, const int* context,
               const int* leading, int* info);
void pdpotrf_(const char* triangle, const int* n, double* a, const int* row, const int* col,
              const int* descriptor, int* info);
void pdpotrs_(const char* triangle, const int* n, const int* right_sides, const double* a,
              const int* row, const int* col, const int* descriptor, double* b, const int* b_row,
              const int* b_col, const int* b_descriptor, int* info);
void pdtrsm_(const char* side, const char* triangle, const char* transposed, const char* diagonal,
             const int* rows, const int* cols, const double* alpha, const double* a, const int* row,
             const int* col, const int* descriptor, double* b, const int* b_row, const int* b_col,
             const int* b_descriptor);
}

namespace kinescope::gp {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Rows and columns of processes, as square as their number allows.
struct Grid {
  int context = 0;
  int rows = 1, cols = 1;
  int row = 0, col = 0;
  int count = 1, rank = 0;
};

// MPI is one for the whole process, and so is this.
std::unique_ptr<Grid>& present_grid() {
  static std::unique_ptr<Grid> grid;
  return grid;
}

Grid make_grid() {
  Grid out;
  Cblacs_pinfo(&out.rank, &out.count);
  Cblacs_get(-1, 0, &out.context);
  out.rows = static_cast<int>(std::sqrt(out.count));
  while (out.count % out.rows != 0) --out.rows;
  out.cols = out.count / out.rows;
  Cblacs_gridinit(&out.context, "Row", out.rows, out.cols);
  Cblacs_gridinfo(out.context, &out.rows, &out.cols, &out.row, &out.col);
  return out;
}

// In place, the same at every process.
void add_up(const Grid& grid, VectorXd& values) {
  const int size = static_cast<int>(values.size());
  Cdgsum2d(grid.context, "All", " ", size, 1, values.data(), std::max(1, size), -1, -1);
}

// A matrix of which this process has every grid.rows-th row block and every grid.cols-th column
// block.
class SharedMatrix {
 public:
  struct Part {
    Index row, col;          // of the whole
    Index own_row, own_col;  // of what is here
    Index rows, cols;
  };

  SharedMatrix(const Grid& grid, Index rows, Index cols, Index block)
      : grid_(grid), rows_(rows), cols_(cols), block_(block) {
    const int zero = 0;
    const int m = static_cast<int>(rows);
    const int n = static_cast<int>(cols);
    const int nb = static_cast<int>(block);
    const int here_rows = numroc_(&m, &nb, &grid.row, &zero, &grid.rows);
    const int here_cols = numroc_(&n, &nb, &grid.col, &zero, &grid.cols);
    const int leading = std::max(1, here_rows);
    own_.resize(leading, here_cols);
    own_.setZero();
    int info = 0;
    descinit_(descriptor_.data(), &m, &n, &nb, &nb, &zero, &zero, &grid.context, &leading, &info);
    KINESCOPE_CHECK(info == 0, "a descriptor of ScaLAPACK");
    here_rows_ = here_rows;
  }

  [[nodiscard]] std::vector<Part> parts() const {
    std::vector<Part> out;
    for (Index c = 0; c * block_ < own_.cols(); ++c) {
      for (Index r = 0; r * block_ < here_rows_; ++r) {
        Part part{(r * grid_.rows + grid_.row) * block_,
                  (c * grid_.cols + grid_.col) * block_,
                  r * block_,
                  c * block_,
                  0,
                  0};
        part.rows = std::min(block_, rows_ - part.row);
        part.cols = std::min(block_, cols_ - part.col);
        out.push_back(part);
      }
    }
    return out;
  }
  [[nodiscard]] auto block(const Part& part) {
    return own_.block(part.own_row, part.own_col, part.rows, part.cols);
  }
  [[nodiscard]] auto block(const Part& part) const {
    return own_.block(part.own_row, part.own_col, part.rows, part.cols);
  }
  [[nodiscard]] double* data() { return own_.data(); }
  [[nodiscard]] const double* data() const { return own_.data(); }
  [[nodiscard]] const int* descriptor() const { return descriptor_.data(); }
  [[nodiscard]] Index rows() const { return rows_; }
  [[nodiscard]] Index cols() const { return cols_; }

 private:
  Grid grid_;
  Index rows_, cols_, block_;
  Index here_rows_ = 0;
  MatrixXd own_;
  std::array<int, 9> descriptor_{};
};

constexpr int kFirstIndex = 1;  // Fortran's

// The same everywhere: what each process has of a diagonal, in its place, zero elsewhere.
VectorXd diagonal_of(const Grid& grid, const SharedMatrix& matrix) {
  VectorXd out = VectorXd::Zero(matrix.rows());
  for (const SharedMatrix::Part& part : matrix.parts()) {
    if (part.row == part.col) out.segment(part.row, part.rows) = matrix.block(part).diagonal();
  }
  add_up(grid, out);
  return out;
}

// Lower triangle of k(x, x), and noise.
void fill(Workers& workers, const Covariance& covariance, const Prepared& x, const VectorXd& noise,
          SharedMatrix& out) {
  const Index m = covariance.outputs();
  std::vector<SharedMatrix::Part> lower;
  for (const SharedMatrix::Part& part : out.parts()) {
    if (part.row >= part.col) lower.push_back(part);
  }
  workers.run(static_cast<Index>(lower.size()), [&](Index task, Scratch& scratch) {
    const SharedMatrix::Part& part = lower[static_cast<std::size_t>(task)];
    auto block = out.block(part);
    covariance.tile({x, part.row / m, part.rows / m}, {x, part.col / m, part.cols / m}, scratch,
                    block);
    if (part.row == part.col) block.diagonal() += noise.segment(part.row, part.rows);
  });
}

int factor(SharedMatrix& matrix) {
  const int n = static_cast<int>(matrix.rows());
  int info = 0;
  pdpotrf_("L", &n, matrix.data(), &kFirstIndex, &kFirstIndex, matrix.descriptor(), &info);
  KINESCOPE_CHECK(info >= 0, "arguments of pdpotrf");
  return info;
}

// K^-1 y, whole at every process.
VectorXd solved(const Grid& grid, const SharedMatrix& factor, const VectorXd& y, Index block) {
  SharedMatrix right(grid, y.size(), 1, block);
  for (const SharedMatrix::Part& part : right.parts()) {
    right.block(part) = y.segment(part.row, part.rows);
  }
  const int n = static_cast<int>(y.size());
  const int one = 1;
  int info = 0;
  pdpotrs_("L", &n, &one, factor.data(), &kFirstIndex, &kFirstIndex, factor.descriptor(),
           right.data(), &kFirstIndex, &kFirstIndex, right.descriptor(), &info);
  KINESCOPE_CHECK(info == 0, "arguments of pdpotrs");
  VectorXd out = VectorXd::Zero(y.size());
  for (const SharedMatrix::Part& part : right.parts()) {
    out.segment(part.row, part.rows) = right.block(part);
  }
  add_up(grid, out);
  return out;
}

[[noreturn]] void refuse_several(const char* what) {
  throw bad_request(what, "not for several processes", "leave mpirun out");
}

class DistributedPosterior : public Posterior {
 public:
  DistributedPosterior(Grid grid, Covariance covariance, Prepared training, SharedMatrix factor,
                       VectorXd alpha)
      : grid_(grid),
        covariance_(std::move(covariance)),
        training_(std::move(training)),
        factor_(std::move(factor)),
        alpha_(std::move(alpha)) {}

  [[nodiscard]] Moments predict(Workers& workers, const Inputs& inputs,
                                bool variance) const override {
    const Prepared at = covariance_.prepare(inputs);
    Moments out;
    out.mean = means(workers, at);
    if (!variance) return out;
    out.variance = covariance_.diagonal(workers, at);
    const Index panel = kPanelBlocks * grid_.cols * covariance_.tile_samples();
    for (Index begin = 0; begin < at.samples; begin += panel) {
      take_off(workers, at, begin, std::min(panel, at.samples - begin), out.variance);
    }
    return out;
  }

  void mean_of_one(OneSample& work) const override {
    gp::mean_of_one(covariance_, training_, alpha_, work);
  }

  void variance_of_one(OneSample&) const override { refuse_several("variance of one sample"); }
  [[nodiscard]] LeftOut leave_out(Workers&, const std::vector<std::vector<Index>>&) const override {
    refuse_several("leave_out");
  }
  [[nodiscard]] VectorXd kernel_weights() const override { return alpha_; }
  [[nodiscard]] Moments at_training(Workers&) const override { refuse_several("at_training"); }

 private:
  static constexpr Index kPanelBlocks = 4;  // 1024 samples a process column at a time

  // Every process takes its share of the samples.
  [[nodiscard]] VectorXd means(Workers& workers, const Prepared& at) const {
    const Index m = covariance_.outputs();
    VectorXd out = VectorXd::Zero(at.samples * m);
    covariance_.cross_panels(workers, training_, at, {grid_.rank, grid_.count},
                             [&](Index begin, Index size, Block cross) {
                               transposed_product(1.0, cross, alpha_, 0.0,
                                                  out.segment(begin * m, size * m));
                             });
    add_up(grid_, out);
    return out;
  }

  // variance - |L^-1 k(x, at)|^2 of some samples.
  void take_off(Workers& workers, const Prepared& at, Index begin, Index size,
                VectorXd& variance) const {
    const Index m = covariance_.outputs();
    SharedMatrix cross(grid_, factor_.rows(), size * m, covariance_.tile_samples() * m);
    const std::vector<SharedMatrix::Part> parts = cross.parts();
    workers.run(static_cast<Index>(parts.size()), [&](Index task, Scratch& scratch) {
      const SharedMatrix::Part& part = parts[static_cast<std::size_t>(task)];
      covariance_.tile({training_, part.row / m, part.rows / m},
                       {at, begin + part.col / m, part.cols / m}, scratch, cross.block(part));
    });
    const int n = static_cast<int>(cross.rows());
    const int columns = static_cast<int>(cross.cols());
    const double one = 1.0;
    pdtrsm_("L", "L", "N", "N", &n, &columns, &one, factor_.data(), &kFirstIndex, &kFirstIndex,
            factor_.descriptor(), cross.data(), &kFirstIndex, &kFirstIndex, cross.descriptor());
    VectorXd explained = VectorXd::Zero(size * m);
    for (const SharedMatrix::Part& part : parts) {
      explained.segment(part.col, part.cols) +=
          cross.block(part).colwise().squaredNorm().transpose();
    }
    add_up(grid_, explained);
    auto own = variance.segment(begin * m, size * m);
    own = (own - explained).cwiseMax(0.0).eval();
  }

  Grid grid_;
  Covariance covariance_;
  Prepared training_;
  SharedMatrix factor_;
  VectorXd alpha_;
};

}  // namespace

// Open MPI says so to whom it starts. By itself a process needs no MPI, which starts but once.
ProcessGroup::ProcessGroup() {
  if (std::getenv("OMPI_COMM_WORLD_SIZE") == nullptr) return;
  KINESCOPE_CHECK(!present_grid(), "one group at a time");
  present_grid() = std::make_unique<Grid>(make_grid());
}

ProcessGroup::~ProcessGroup() {
  if (!present_grid() || std::uncaught_exceptions() > 0) return;
  Cblacs_gridexit(present_grid()->context);
  present_grid().reset();
  Cblacs_exit(0);
}

int process_count() { return present_grid() ? present_grid()->count : 1; }
int process_rank() { return present_grid() ? present_grid()->rank : 0; }

// Open MPI says how many of the processes it started on this machine.
double machine_share() {
  const char* here = std::getenv("OMPI_COMM_WORLD_LOCAL_SIZE");
  if (!present_grid() || here == nullptr) return 1.0;
  return std::atof(here) / present_grid()->count;
}

Fit fit_distributed(Workers& workers, const Kernel& kernel, const VectorXd& log_noise,
                    Problem problem, const FitOptions& options) {
  const Grid& grid = *present_grid();
  check_memory(problem.samples, problem.outputs, machine_share(), options.memory_limit_bytes);
  Covariance covariance(kernel);
  Prepared training = covariance.prepare(problem.inputs);
  const VectorXd noise = noise_of_rows(problem, log_noise);
  const Index block = covariance.tile_samples() * covariance.outputs();
  SharedMatrix matrix(grid, problem.rows(), problem.rows(), block);
  Fit out;
  out.jitter = with_jitter(covariance, problem.samples, options.max_jitter, [&](double relative) {
    fill(workers, covariance, training, noise, matrix);
    const double jitter = relative * diagonal_of(grid, matrix).mean();
    for (const SharedMatrix::Part& part : matrix.parts()) {
      if (part.row == part.col) matrix.block(part).diagonal().array() += jitter;
    }
    return Attempt{jitter, factor(matrix)};
  });
  VectorXd alpha = solved(grid, matrix, problem.targets, block);
  out.log_likelihood = -0.5 * problem.targets.dot(alpha) -
                       diagonal_of(grid, matrix).array().log().sum() -
                       0.5 * static_cast<double>(alpha.size()) * std::log(2.0 * std::numbers::pi);
  out.posterior = std::make_shared<DistributedPosterior>(
      grid, std::move(covariance), std::move(training), std::move(matrix), std::move(alpha));
  return out;
}

}  // namespace kinescope::gp
