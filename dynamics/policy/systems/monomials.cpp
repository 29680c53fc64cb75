// SPDX-License-Identifier: Apache-2.0
#include "dynamics/policy/systems/monomials.h"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "kinematics/core/error.h"

namespace kinescope::policy {
namespace {

double power(double base, int exponent) {
  double out = 1.0;
  for (int k = 0; k < exponent; ++k) out *= base;
  return out;
}

std::vector<std::string> parts_of(const std::string& text, char at) {
  std::vector<std::string> out(1);
  for (const char c : text) {
    if (c == at) {
      out.emplace_back();
    } else {
      out.back() += c;
    }
  }
  return out;
}

}  // namespace

Monomials::Monomials(const StateLayout& layout, const std::vector<std::string>& words) {
  std::vector<std::string> names = feature_names(layout);
  names.insert(names.end(), layout.inputs.begin(), layout.inputs.end());
  exponents_ = Eigen::MatrixXi::Zero(std::ssize(words), std::ssize(names));
  for (Eigen::Index row = 0; row < exponents_.rows(); ++row) {
    const std::string& word = words[static_cast<std::size_t>(row)];
    for (const std::string& factor : parts_of(word, '*')) {
      const std::vector<std::string> parts = parts_of(factor, '^');
      const auto found = std::ranges::find(names, parts.front());
      if (found == names.end()) {
        throw bad_request(word, fmt::format("'{}' is no column", parts.front()),
                          fmt::format("take {}", fmt::join(names, ", ")));
      }
      exponents_(row, found - names.begin()) += parts.size() > 1 ? std::stoi(parts[1]) : 1;
    }
  }
}

void Monomials::evaluate(const ConstBlock& inputs, Block values) const {
  for (Eigen::Index f = 0; f < count(); ++f) {
    for (Eigen::Index i = 0; i < inputs.rows(); ++i) {
      double product = 1.0;
      for (Eigen::Index d = 0; d < exponents_.cols(); ++d) {
        product *= power(inputs(i, d), exponents_(f, d));
      }
      values(i, f) = product;
    }
  }
}

void Monomials::pullback(const ConstBlock& inputs, const ConstBlock& d_values,
                         Block d_inputs) const {
  for (Eigen::Index f = 0; f < count(); ++f) {
    for (Eigen::Index by = 0; by < exponents_.cols(); ++by) {
      if (exponents_(f, by) == 0) continue;
      for (Eigen::Index i = 0; i < inputs.rows(); ++i) {
        double slope = exponents_(f, by) * power(inputs(i, by), exponents_(f, by) - 1);
        for (Eigen::Index d = 0; d < exponents_.cols(); ++d) {
          if (d != by) slope *= power(inputs(i, d), exponents_(f, d));
        }
        d_inputs(i, by) += slope * d_values(i, f);
      }
    }
  }
}

}  // namespace kinescope::policy
