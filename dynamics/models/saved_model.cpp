// SPDX-License-Identifier: Apache-2.0
//
// Apart from torque_predictor.cpp: a controller that predicts single samples links neither threads
// nor a linear algebra library.
#include "dynamics/gp/workers.h"
#include "dynamics/identify/term_size.h"
#include "dynamics/models/torque_predictor.h"

namespace kinescope {

using Eigen::Index;

TorquePrediction predict_torque(const SavedTorqueModel& model, const Eigen::MatrixXd& q,
                                const Eigen::MatrixXd& dq, const Eigen::MatrixXd& ddq,
                                int threads) {
  TorquePrediction out{Eigen::MatrixXd(q.rows(), q.cols()), Eigen::MatrixXd(q.rows(), q.cols()),
                       Eigen::MatrixXd(q.rows(), q.cols())};
  gp::Workers workers(threads);
  const Index parts = std::min<Index>(workers.count(), std::max<Index>(1, q.rows()));
  workers.run(parts, [&](Index part, gp::Scratch&) {
    TorquePredictor predictor(model);
    for (Index i = part * q.rows() / parts; i < (part + 1) * q.rows() / parts; ++i) {
      out.mean.row(i) =
          predictor.mean(q.row(i).transpose(), dq.row(i).transpose(), ddq.row(i).transpose());
      out.sigma.row(i) = predictor.sigma();
      out.model_sigma.row(i) = predictor.model_sigma();
    }
  });
  return out;
}

SavedParametric saved_parametric(const Identification& identification) {
  SavedParametric out;
  out.terms = identification.basis.kept;
  out.parameters = identification.parameters;
  out.covariance = identification.covariance;
  out.undetermined = identification.undetermined;
  out.gains = identification.gains;
  out.sigma = identification.sigma;
  for (const int k : out.undetermined) {
    out.covariance.row(k).setZero();
    out.covariance.col(k).setZero();
  }
  // To the last bit: files hold one triangle.
  out.covariance = (0.5 * (out.covariance + out.covariance.transpose())).eval();
  if (out.undetermined.empty()) return out;
  std::vector<TorqueTerm> kept;
  for (const int k : out.terms) kept.push_back(identification.terms[static_cast<std::size_t>(k)]);
  out.acting =
      identify::kAtRest * identify::usual_sizes(identification.rigid, identification.drives, kept);
  return out;
}

MotionSpan span_of(const TorqueSamples& samples) {
  return {samples.q.colwise().minCoeff(), samples.q.colwise().maxCoeff(),
          samples.dq.cwiseAbs().colwise().maxCoeff(), samples.ddq.cwiseAbs().colwise().maxCoeff()};
}

}  // namespace kinescope
