// SPDX-License-Identifier: Apache-2.0
//
// The whole rollout written once more, on scalars and with the inverse of the kernel matrix, in
// dual numbers: cost and gradient of the two must agree.
#include <cmath>

#include <Eigen/Cholesky>
#include <ceres/jet.h>
#include <gtest/gtest.h>

#include "dynamics/policy/draws.h"
#include "dynamics/policy/improve.h"
#include "dynamics/policy/kernel_matrix.h"
#include "dynamics/policy/particle_objective.h"
#include "tests/dynamics/policy/policy_world.h"

namespace kinescope::policy {
namespace {

using Eigen::Index;

constexpr int kBasis = 3;
constexpr int kParameters = kBasis * 5 + 5 + kBasis;
using Dual = ceres::Jet<double, kParameters>;
template <typename T>
using Vector = Eigen::Matrix<T, Eigen::Dynamic, 1>;

// features of (cart, angle, cart speed, angle rate).
Vector<Dual> features_of(const Vector<Dual>& x) {
  Vector<Dual> out(5);
  out << x[0], x[2], x[3], sin(x[1]), cos(x[1]);
  return out;
}

Dual policy_of(const Vector<Dual>& parameters, const Vector<Dual>& z, const RolloutDraws& draws,
               Index particle, int time) {
  Eigen::MatrixXd mask(1, kBasis + 1);
  draw_dropout({draws.seed, Use::kDropout, draws.step, static_cast<std::uint32_t>(time)},
               draws.dropout, particle, mask);
  Dual sum(0.0);
  for (int b = 0; b < kBasis; ++b) {
    Dual squares(0.0);
    for (int f = 0; f < 5; ++f) {
      const Dual e = (z[f] - parameters[b * 5 + f]) / exp(parameters[kBasis * 5 + f]);
      squares += e * e;
    }
    sum += mask(0, b) * 10.0 * parameters[kBasis * 5 + 5 + b] * exp(-0.5 * squares);
  }
  return 10.0 * tanh(sum / 10.0);
}

struct Moments {
  Dual mean;
  Dual deviation;
};

Moments predict(const VelocityProcess& process, const Vector<Dual>& x) {
  Eigen::MatrixXd a = kernel_matrix(process.kernel, process.inputs, process.inputs, nullptr);
  a.diagonal().array() += process.kernel.noise_variance;
  const Eigen::MatrixXd inverse = a.llt().solve(Eigen::MatrixXd::Identity(a.rows(), a.cols()));
  const Index samples = process.inputs.rows();
  Vector<Dual> k(samples);
  for (Index j = 0; j < samples; ++j) {
    Dual squares(0.0);
    for (Index d = 0; d < x.size(); ++d) {
      const Dual e = (x[d] - process.inputs(j, d)) / process.kernel.length_scales[d];
      squares += e * e;
    }
    k[j] = process.kernel.variance * exp(-0.5 * squares);
  }
  const Eigen::VectorXd weights = inverse * process.targets;
  Moments out{Dual(0.0), Dual(process.kernel.variance)};
  for (Index i = 0; i < samples; ++i) {
    out.mean += k[i] * weights[i];
    for (Index j = 0; j < samples; ++j) out.deviation -= inverse(i, j) * k[i] * k[j];
  }
  out.deviation = sqrt(out.deviation);
  return out;
}

Dual cost_of(const SaturatingCost& cost, const Vector<Dual>& x) {
  const Dual cart = (x[0] - cost.terms[0].target) / cost.terms[0].length_scale;
  const Dual pole = (abs(x[1]) - cost.terms[1].target) / cost.terms[1].length_scale;
  return 1.0 - exp(-(cart * cart + pole * pole));
}

Dual rollout(const VelocityModel& model, const PolicyTask& task, const Vector<Dual>& parameters,
             const RolloutDraws& draws, Index particle) {
  Eigen::MatrixXd start(1, 4);
  draw_normals({draws.seed, Use::kStart, draws.step, 0}, particle, start);
  Vector<Dual> x(4);
  for (int i = 0; i < 4; ++i)
    x[i] = Dual(task.start.means(0, i) + task.start.sigma[i] * start(0, i));
  Dual total = cost_of(task.cost, x);
  for (int t = 0; t < task.steps; ++t) {
    const Vector<Dual> z = features_of(x);
    Vector<Dual> input(6);
    input << z, policy_of(parameters, z, draws, particle, t);
    Eigen::MatrixXd normals(1, 2);
    draw_normals({draws.seed, Use::kTransition, draws.step, static_cast<std::uint32_t>(t)},
                 particle, normals);
    Vector<Dual> next = x;
    for (int p = 0; p < 2; ++p) {
      const VelocityProcess& process = model.processes[static_cast<std::size_t>(p)];
      const Moments m = predict(process, input);
      const Dual increment = process.target_scale * (m.mean + m.deviation * normals(0, p));
      next[2 + p] += increment;
      next[p] += 0.05 * x[2 + p] + 0.025 * increment;
    }
    x = next;
    total += cost_of(task.cost, x);
  }
  return total;
}

TEST(Rollout, AgreesWithDualNumbers) {
  constexpr int kParticles = 3;
  const VelocityModel model = random_model(VelocityKernel::kSquaredExponential, 8);
  const PolicyTask task = random_task(5);
  const RbfPolicy policy = random_policy(kBasis);
  const RolloutDraws draws{11, 4, 0.25};
  const Eigen::VectorXd at = parameters_of(policy);
  Vector<Dual> parameters(kParameters);
  for (int i = 0; i < kParameters; ++i) parameters[i] = Dual(at[i], i);
  Dual expected(0.0);
  for (Index i = 0; i < kParticles; ++i) {
    expected += rollout(model, task, parameters, draws, i) / static_cast<double>(kParticles);
  }
  ParticleObjective objective(model, task, kParticles, kBasis, 1);
  PolicyGradient gradient(policy);
  const ParticleCost cost = objective.evaluate(policy, draws, &gradient);
  const Eigen::VectorXd exact = search_gradient(gradient, policy);
  constexpr double kRelative = 1e-9;
  EXPECT_NEAR(cost.cost, expected.a, kRelative * expected.a);
  EXPECT_LT((exact - expected.v).cwiseAbs().maxCoeff(), kRelative * exact.cwiseAbs().maxCoeff());
  EXPECT_GT(exact.cwiseAbs().maxCoeff(), 1e-3);
}

}  // namespace
}  // namespace kinescope::policy
