// SPDX-License-Identifier: Apache-2.0
#include "kinematics/core/student_t.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "kinematics/core/rng.h"

namespace kinescope {
namespace {

// Squared lengths of `count` planar residuals of standard deviation `sigma`.
std::vector<double> planar(int count, double sigma) {
  Rng rng = Rng::from_name("student t");
  std::vector<double> out;
  for (int i = 0; i < count; ++i) {
    const double x = rng.normal(sigma), y = rng.normal(sigma);
    out.push_back(x * x + y * y);
  }
  return out;
}

// By the density itself, of two coordinates and four degrees of freedom: 1 / (2 pi s)
// (1 + r2 / (4 s))^-3.
double deviance_at(const std::vector<double>& squares, double s) {
  double out = 0.0;
  for (const double r2 : squares)
    out += 6.0 * std::log1p(r2 / (4.0 * s)) + 2.0 * std::log(2.0 * M_PI * s);
  return out;
}

TEST(StudentT, NoOtherScaleIsMoreProbable) {
  const std::vector<double> squares = planar(200, 0.3);
  const StudentT fit = fit_student_t(squares, 2.0, 1e-12);
  EXPECT_NEAR(fit.deviance, deviance_at(squares, fit.scale_squared), 1e-6);
  for (const double other : {0.5, 0.9, 0.999, 1.001, 1.1, 2.0})
    EXPECT_LT(fit.deviance, deviance_at(squares, other * fit.scale_squared));
}

// Ten of a thousand that are 1000 times as far: the mean square rises by four orders.
TEST(StudentT, OutliersMoveTheScaleByLittle) {
  std::vector<double> squares = planar(1000, 0.3);
  const double clean = fit_student_t(squares, 2.0, 1e-12).scale_squared;
  for (std::size_t i = 0; i < 10; ++i) squares[i] *= 1e6;
  const double with = fit_student_t(squares, 2.0, 1e-12).scale_squared;
  EXPECT_GT(with, clean);
  EXPECT_LT(with, 1.1 * clean);
}

TEST(StudentT, ResidualsWithoutNoiseAreFinitelyProbable) {
  const StudentT fit = fit_student_t(std::vector<double>(5, 0.0), 2.0, 1e-12);
  EXPECT_EQ(fit.scale_squared, 1e-12);
  EXPECT_TRUE(std::isfinite(fit.deviance));
  EXPECT_EQ(fit_student_t({}, 2.0, 1e-12).deviance, 0.0);
}

}  // namespace
}  // namespace kinescope
