// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <functional>

#include "dynamics/gp/kernel_node.h"
#include "kinematics/core/error.h"

namespace kinescope::gp {
namespace {

using Eigen::Index;
using NodePtr = std::shared_ptr<const KernelNode>;

// Children with their parameters one after another.
class Composite : public KernelNode {
 public:
  explicit Composite(std::vector<NodePtr> children) : children_(std::move(children)) {
    for (const NodePtr& child : children_) {
      starts_.push_back(count_);
      count_ += child->parameter_count();
      columns_ = std::max(columns_, child->input_columns());
    }
  }

  [[nodiscard]] int input_columns() const override { return columns_; }
  [[nodiscard]] Index parameter_count() const override { return count_; }
  [[nodiscard]] const std::vector<NodePtr>& children() const { return children_; }

  void featurise(const Inputs& inputs, Prepared& out) const override {
    out.samples = inputs.rows();
    out.children.resize(children_.size());
    for (std::size_t c = 0; c < children_.size(); ++c) {
      children_[c]->featurise(inputs, out.children[c]);
    }
  }
  void rescale(const Theta& theta, Prepared& out) const override {
    for (std::size_t c = 0; c < children_.size(); ++c) {
      children_[c]->rescale(part(theta, c), out.children[c]);
    }
  }

 protected:
  [[nodiscard]] Theta part(const Theta& theta, std::size_t child) const {
    return theta.segment(starts_[child], children_[child]->parameter_count());
  }
  [[nodiscard]] Gradient part(Gradient& gradient, std::size_t child) const {
    return gradient.segment(starts_[child], children_[child]->parameter_count());
  }
  [[nodiscard]] Index start(std::size_t child) const { return starts_[child]; }
  /// Of all children, from the count of none; nothing when one has no features.
  template <typename Combine>
  [[nodiscard]] std::optional<double> combined_features(double total, Combine combine) const {
    for (const NodePtr& child : children_) {
      const std::optional<double> count = child->feature_count();
      if (!count) return std::nullopt;
      total = combine(total, *count);
    }
    return total;
  }
  /// The children's features side by side: those of child c in rows `first_row(c)` and on.
  template <typename FirstRow>
  [[nodiscard]] Basis bases_side_by_side(const Inputs& inputs, FirstRow first_row) const {
    const auto features = static_cast<Index>(feature_count().value_or(0.0));
    Basis out{Eigen::MatrixXd::Zero(inputs.rows() * outputs(), features),
              Eigen::MatrixXd::Zero(features, parameter_count())};
    Index at = 0;
    for (std::size_t c = 0; c < children_.size(); ++c) {
      const Basis own = children_[c]->basis(inputs);
      out.values.block(first_row(c), at, own.values.rows(), own.values.cols()) = own.values;
      out.exponents.block(at, start(c), own.exponents.rows(), own.exponents.cols()) = own.exponents;
      at += own.values.cols();
    }
    return out;
  }

 private:
  std::vector<NodePtr> children_;
  std::vector<Index> starts_;
  Index count_ = 0;
  int columns_ = 0;
};

class SumNode : public Composite {
 public:
  using Composite::Composite;

  [[nodiscard]] int outputs() const override { return children().front()->outputs(); }

  void evaluate(const Theta& theta, Samples a, Samples b, Scratch& scratch,
                Block out) const override {
    const Scratch::Frame frame(scratch);
    children()[0]->evaluate(part(theta, 0), a.child(0), b.child(0), scratch, out);
    Eigen::Map<Eigen::MatrixXd> term = scratch.take(out.rows(), out.cols());
    for (std::size_t c = 1; c < children().size(); ++c) {
      children()[c]->evaluate(part(theta, c), a.child(c), b.child(c), scratch, term);
      out += term;
    }
  }

  void contract(const Theta& theta, Samples a, Samples b, const ConstBlock& q, Scratch& scratch,
                Gradient gradient) const override {
    for (std::size_t c = 0; c < children().size(); ++c) {
      children()[c]->contract(part(theta, c), a.child(c), b.child(c), q, scratch,
                              part(gradient, c));
    }
  }

  [[nodiscard]] std::optional<double> feature_count() const override {
    return combined_features(0.0, std::plus<>{});
  }

  [[nodiscard]] Basis basis(const Inputs& inputs) const override {
    return bases_side_by_side(inputs, [](std::size_t) { return Index{0}; });
  }
};

class ProductNode : public Composite {
 public:
  using Composite::Composite;

  void evaluate(const Theta& theta, Samples a, Samples b, Scratch& scratch,
                Block out) const override {
    children()[0]->evaluate(part(theta, 0), a.child(0), b.child(0), scratch, out);
    for (std::size_t c = 1; c < children().size(); ++c) {
      children()[c]->multiply(part(theta, c), a.child(c), b.child(c), scratch, out);
    }
  }

  // Each factor sees Q times the product of the others: products from the left are kept, those
  // from the right run along. No division, so factors may vanish.
  void contract(const Theta& theta, Samples a, Samples b, const ConstBlock& q, Scratch& scratch,
                Gradient gradient) const override {
    const Scratch::Frame frame(scratch);
    const std::size_t count = children().size();
    std::vector<Eigen::Map<Eigen::MatrixXd>> left;
    left.reserve(count);
    left.push_back(scratch.take(q.rows(), q.cols()));
    left[0] = q;
    for (std::size_t c = 1; c < count; ++c) {
      left.push_back(scratch.take(q.rows(), q.cols()));
      left[c] = left[c - 1];
      children()[c - 1]->multiply(part(theta, c - 1), a.child(c - 1), b.child(c - 1), scratch,
                                  left[c]);
    }
    Eigen::Map<Eigen::MatrixXd> right = scratch.take(q.rows(), q.cols());
    right.setOnes();
    for (std::size_t c = count; c-- > 0;) {
      if (c + 1 < count) left[c].array() *= right.array();
      children()[c]->contract(part(theta, c), a.child(c), b.child(c), left[c], scratch,
                              part(gradient, c));
      if (c > 0) {
        children()[c]->multiply(part(theta, c), a.child(c), b.child(c), scratch, right);
      }
    }
  }

  [[nodiscard]] std::optional<double> feature_count() const override {
    return combined_features(1.0, std::multiplies<>{});
  }

  [[nodiscard]] Basis basis(const Inputs& inputs) const override {
    Basis out{Eigen::MatrixXd::Ones(inputs.rows(), 1), Eigen::MatrixXd::Zero(1, parameter_count())};
    for (std::size_t c = 0; c < children().size(); ++c) {
      const Basis factor = children()[c]->basis(inputs);
      Basis next{Eigen::MatrixXd(inputs.rows(), out.values.cols() * factor.values.cols()),
                 Eigen::MatrixXd(out.values.cols() * factor.values.cols(), parameter_count())};
      Index at = 0;
      for (Index f = 0; f < factor.values.cols(); ++f) {
        for (Index g = 0; g < out.values.cols(); ++g, ++at) {
          next.values.col(at) = out.values.col(g).cwiseProduct(factor.values.col(f));
          next.exponents.row(at) = out.exponents.row(g);
          next.exponents.row(at).segment(start(c), factor.exponents.cols()) =
              factor.exponents.row(f);
        }
      }
      out = std::move(next);
    }
    return out;
  }
};

// Output o of the first, .. : blocks on the diagonal.
class IndependentNode : public Composite {
 public:
  using Composite::Composite;

  [[nodiscard]] int outputs() const override { return static_cast<int>(children().size()); }

  void evaluate(const Theta& theta, Samples a, Samples b, Scratch& scratch,
                Block out) const override {
    out.setZero();
    for (std::size_t c = 0; c < children().size(); ++c) {
      const auto k = static_cast<Index>(c);
      children()[c]->evaluate(part(theta, c), a.child(c), b.child(c), scratch,
                              out.block(k * a.size, k * b.size, a.size, b.size));
    }
  }

  void contract(const Theta& theta, Samples a, Samples b, const ConstBlock& q, Scratch& scratch,
                Gradient gradient) const override {
    for (std::size_t c = 0; c < children().size(); ++c) {
      const auto k = static_cast<Index>(c);
      children()[c]->contract(part(theta, c), a.child(c), b.child(c),
                              q.block(k * a.size, k * b.size, a.size, b.size), scratch,
                              part(gradient, c));
    }
  }

  [[nodiscard]] std::optional<double> feature_count() const override {
    return combined_features(0.0, std::plus<>{});
  }

  [[nodiscard]] Basis basis(const Inputs& inputs) const override {
    return bases_side_by_side(inputs,
                              [&](std::size_t c) { return static_cast<Index>(c) * inputs.rows(); });
  }
};

// Children of the same kind are taken in: (a + b) + c is one sum of three.
template <typename Node>
std::vector<NodePtr> flattened(const std::vector<NodePtr>& nodes) {
  std::vector<NodePtr> out;
  for (const NodePtr& node : nodes) {
    if (const auto* same = dynamic_cast<const Node*>(node.get())) {
      out.insert(out.end(), same->children().begin(), same->children().end());
    } else {
      out.push_back(node);
    }
  }
  return out;
}

}  // namespace

void KernelNode::multiply(const Theta& theta, Samples a, Samples b, Scratch& scratch,
                          Block out) const {
  const Scratch::Frame frame(scratch);
  Eigen::Map<Eigen::MatrixXd> factor = scratch.take(out.rows(), out.cols());
  evaluate(theta, a, b, scratch, factor);
  out.array() *= factor.array();
}

Basis KernelNode::basis(const Inputs&) const {
  KINESCOPE_CHECK(false, "a kernel of infinite dimension has no features");
  return {};
}

NodePtr make_sum(const std::vector<NodePtr>& terms) {
  return std::make_shared<SumNode>(flattened<SumNode>(terms));
}

NodePtr make_product(const std::vector<NodePtr>& factors) {
  return std::make_shared<ProductNode>(flattened<ProductNode>(factors));
}

Kernel independent_outputs(const std::vector<Kernel>& kernels) {
  std::vector<NodePtr> nodes;
  std::vector<Parameter> parameters;
  for (std::size_t k = 0; k < kernels.size(); ++k) {
    KINESCOPE_CHECK(kernels[k].outputs() == 1, "each kernel is for one output");
    nodes.push_back(kernels[k].shared_node());
    for (Parameter parameter : kernels[k].parameters()) {
      parameter.name = "output " + std::to_string(k) + " " + parameter.name;
      parameters.push_back(std::move(parameter));
    }
  }
  KINESCOPE_CHECK(!nodes.empty(), "at least one output");
  return {std::make_shared<IndependentNode>(std::move(nodes)), std::move(parameters)};
}

}  // namespace kinescope::gp
