// SPDX-License-Identifier: Apache-2.0
//
// Features of physics that are products of powers of a model's inputs: for mechanisms with few
// degrees of freedom, the terms of their equations of motion.
#pragma once

#include <string>
#include <vector>

#include "dynamics/policy/velocity_model.h"

namespace kinescope::policy {

class Monomials : public PhysicsFeatures {
 public:
  /// Each word is a product of columns by their names (feature_names(), then the inputs), as
  /// "pole speed^2*sin pole"; throws bad_request for a name that is none.
  Monomials(const StateLayout& layout, const std::vector<std::string>& words);

  [[nodiscard]] Eigen::Index count() const override { return exponents_.rows(); }
  void evaluate(const ConstBlock& inputs, Block values) const override;
  void pullback(const ConstBlock& inputs, const ConstBlock& d_values,
                Block d_inputs) const override;

 private:
  Eigen::MatrixXi exponents_;  ///< count x D
};

}  // namespace kinescope::policy
