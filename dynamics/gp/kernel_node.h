// SPDX-License-Identifier: Apache-2.0
//
// What a kernel must be able to do; internal. Work is done in tiles (some samples against some
// samples), so that sums, products and gradients of kernels never need more than one large matrix.
// A tile of a kernel with several outputs is output-major: row = output * samples + sample.
#pragma once

#include <optional>

#include "dynamics/gp/kernel.h"
#include "dynamics/gp/workers.h"

namespace kinescope::gp {

/// log values of a node's own parameters.
using Theta = Eigen::Ref<const Eigen::VectorXd>;
using Gradient = Eigen::Ref<Eigen::VectorXd>;

/// What a kernel keeps of its inputs (scaled features and the like). Reused without allocation.
struct Prepared {
  Eigen::Index samples = 0;
  std::vector<Eigen::MatrixXd> tables;
  std::vector<Prepared> children;
};

/// Samples begin .. begin + size - 1 of prepared inputs.
struct Samples {
  const Prepared& of;
  Eigen::Index begin;
  Eigen::Index size;

  [[nodiscard]] auto rows(std::size_t table) const {
    return of.tables[table].middleRows(begin, size);
  }
  [[nodiscard]] Samples child(std::size_t index) const { return {of.children[index], begin, size}; }
};

/// Finitely many features phi_f with k = sum_f s_f phi_f phi_f' and log s = exponents * theta:
/// all polynomial kernels are of this kind.
struct Basis {
  Eigen::MatrixXd values;     ///< (outputs * samples, output-major) x features
  Eigen::MatrixXd exponents;  ///< features x parameters
};

class KernelNode {
 public:
  KernelNode() = default;
  virtual ~KernelNode() = default;
  KernelNode(const KernelNode&) = delete;
  KernelNode& operator=(const KernelNode&) = delete;

  [[nodiscard]] virtual int outputs() const { return 1; }
  [[nodiscard]] virtual int input_columns() const = 0;
  [[nodiscard]] virtual Eigen::Index parameter_count() const = 0;
  /// What is the same for all theta: the features as they are.
  virtual void featurise(const Inputs& inputs, Prepared& out) const = 0;
  /// The rest, from that; may be called again with another theta.
  virtual void rescale(const Theta& theta, Prepared& out) const = 0;
  /// out = k.
  virtual void evaluate(const Theta& theta, Samples a, Samples b, Scratch& scratch,
                        Block out) const = 0;
  /// out *= k, elementwise.
  virtual void multiply(const Theta& theta, Samples a, Samples b, Scratch& scratch,
                        Block out) const;
  /// gradient += d/dtheta sum_ij q_ij k_ij.
  virtual void contract(const Theta& theta, Samples a, Samples b, const ConstBlock& q,
                        Scratch& scratch, Gradient gradient) const = 0;
  /// Number of features; nothing for kernels of infinite dimension. As double: products explode.
  [[nodiscard]] virtual std::optional<double> feature_count() const { return std::nullopt; }
  [[nodiscard]] virtual Basis basis(const Inputs& inputs) const;
};

/// Nodes of kernel_algebra.cpp know how to take each other apart.
[[nodiscard]] std::shared_ptr<const KernelNode> make_sum(
    const std::vector<std::shared_ptr<const KernelNode>>& terms);
[[nodiscard]] std::shared_ptr<const KernelNode> make_product(
    const std::vector<std::shared_ptr<const KernelNode>>& factors);

}  // namespace kinescope::gp
