// SPDX-License-Identifier: Apache-2.0
#include "dynamics/gp/robust.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/dynamics/gp/gp_samples.h"

namespace kinescope::gp {
namespace {

struct Spoilt {
  Dataset data;
  Dataset clean;
  std::vector<Eigen::Index> outliers;
};

// Every twelfth sample is off by 20 sigma, all to one side.
Spoilt spoilt_data(std::string_view name) {
  Rng rng = Rng::from_name(name);
  Spoilt out;
  // Inputs without lonely samples: nothing can tell that one of those is wrong.
  out.clean = smooth_data(rng, 2400, 2, 0.05);
  std::vector<Eigen::Index> inner;
  for (Eigen::Index i = 0; inner.size() < 240; ++i) {
    if (out.clean.inputs.row(i).cwiseAbs().maxCoeff() < 1.5) inner.push_back(i);
  }
  out.clean = subset(out.clean, inner);
  out.data = out.clean;
  for (Eigen::Index i = 5; i < 240; i += 12) {
    out.data.targets(i, 0) += 1.0;
    out.outliers.push_back(i);
  }
  return out;
}

double rms_against(const FittedGp& fitted, const FittedGp& reference, const Eigen::MatrixXd& x) {
  return std::sqrt((predict(fitted, x).mean - predict(reference, x).mean).squaredNorm() /
                   static_cast<double>(x.rows()));
}

TEST(Robust, StudentNoiseIgnoresOutliers) {
  const Spoilt set = spoilt_data("student");
  for (const Kernel& kernel : {rbf(first_columns(2)), polynomial(first_columns(2), 5)}) {
    const GpModel model = make_model(kernel, 0.0025);
    const FittedGp clean = fit(model, set.clean);
    const FittedGp plain = fit(model, set.data);
    const RobustFit robust = fit_student(model, set.data);
    EXPECT_TRUE(robust.converged);
    for (const Eigen::Index i : set.outliers) EXPECT_LT(robust.weight(i, 0), 0.1) << i;
    EXPECT_GT(robust.weight.mean(), 0.8);
    EXPECT_LT(rms_against(robust.fitted, clean, set.data.inputs),
              0.25 * rms_against(plain, clean, set.data.inputs));
  }
}

TEST(Robust, StudentNoiseOnCleanDataIsNearlyThePlainFit) {
  const Spoilt set = spoilt_data("student clean");
  const GpModel model = make_model(rbf(first_columns(2)), 0.0025);
  const RobustFit robust = fit_student(model, set.clean);
  // A fifth of the noise.
  EXPECT_LT(rms_against(robust.fitted, fit(model, set.clean), set.clean.inputs), 0.01);
}

TEST(Robust, TrimmingRemovesTheOutliers) {
  const Spoilt set = spoilt_data("trim");
  const GpModel model = make_model(rbf(first_columns(2)), 0.0025);
  const TrimmedFit trimmed = fit_trimmed(model, set.data, {.widen = 1.5});
  EXPECT_EQ(trimmed.removed.size(), 24U);
  int found = 0;
  for (const Eigen::Index i : set.outliers) {
    found += std::ranges::binary_search(trimmed.removed, i) ? 1 : 0;
  }
  EXPECT_GE(found, static_cast<int>(set.outliers.size()) - 1);
  EXPECT_EQ(trimmed.fitted.samples, 216);
}

TEST(Robust, WideningTouchesLengthScalesOnly) {
  const Kernel kernel = widened(rbf(first_columns(1)) + linear(first_columns(1)), 3.0);
  EXPECT_DOUBLE_EQ(kernel.parameters()[0].value, 1.0);
  EXPECT_DOUBLE_EQ(kernel.parameters()[1].value, 3.0);
  EXPECT_DOUBLE_EQ(kernel.parameters()[3].value, 1.0);
}

}  // namespace
}  // namespace kinescope::gp
