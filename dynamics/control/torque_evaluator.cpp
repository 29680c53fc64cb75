// SPDX-License-Identifier: Apache-2.0
#include "dynamics/control/torque_evaluator.h"

#include <algorithm>
#include <cmath>

#include "dynamics/models/saved_model_file.h"
#include "dynamics/models/torque_model.h"

namespace kinescope {
namespace {

using Eigen::Index;

/// False for another size or a value that is not finite, with the status.
bool take(std::span<const double> values, Eigen::VectorXd& into, TorqueStatus& status) {
  if (std::ssize(values) != into.size()) {
    status = TorqueStatus::kBadArgument;
  } else if (!std::ranges::all_of(values, [](double value) { return std::isfinite(value); })) {
    status = TorqueStatus::kNotFinite;
  } else {
    std::ranges::copy(values, into.data());
    return true;
  }
  return false;
}

}  // namespace

struct TorqueEvaluator::State {
  TorquePredictor predictor;
  RigidModel rigid;
  BandFactors bands;
  std::string torque_unit;
  TorqueModelKind kind;
  bool traced;
  Eigen::VectorXd q, dq, ddq;

  explicit State(const SavedModelFile& file)
      : predictor(file.model),
        rigid(file.model.rigid),
        bands(file.model.bands),
        torque_unit(file.model.torque_unit),
        kind(file.model.kind),
        traced(file.traced) {
    q = dq = ddq = Eigen::VectorXd::Zero(rigid.size());
  }

  [[nodiscard]] double width(TorqueBand band, Index joint) const {
    return band == TorqueBand::k90 ? bands.width_90(joint) : bands.width_95(joint);
  }
};

TorqueEvaluator::TorqueEvaluator(const std::filesystem::path& file)
    : state_(std::make_unique<State>(read_saved_model(file))) {}
TorqueEvaluator::TorqueEvaluator(const SavedTorqueModel& model)
    : state_(std::make_unique<State>(SavedModelFile{model, false})) {}
TorqueEvaluator::~TorqueEvaluator() = default;
TorqueEvaluator::TorqueEvaluator(TorqueEvaluator&&) noexcept = default;
TorqueEvaluator& TorqueEvaluator::operator=(TorqueEvaluator&&) noexcept = default;

std::size_t TorqueEvaluator::joints() const noexcept { return state_->rigid.bodies.size(); }

std::string_view TorqueEvaluator::joint_name(std::size_t joint) const noexcept {
  return joint < joints() ? std::string_view(state_->rigid.bodies[joint].joint)
                          : std::string_view();
}

std::string_view TorqueEvaluator::torque_unit() const noexcept { return state_->torque_unit; }

std::string_view TorqueEvaluator::kind() const noexcept { return to_string(state_->kind); }

bool TorqueEvaluator::traced() const noexcept { return state_->traced; }

TorqueStatus TorqueEvaluator::mean(std::span<const double> q, std::span<const double> dq,
                                   std::span<const double> ddq, std::span<double> torque) noexcept {
  State& own = *state_;
  TorqueStatus status = TorqueStatus::kDone;
  if (torque.size() != joints()) return TorqueStatus::kBadArgument;
  if (!take(q, own.q, status) || !take(dq, own.dq, status) || !take(ddq, own.ddq, status)) {
    return status;
  }
  const Eigen::VectorXd& mean = own.predictor.mean(own.q, own.dq, own.ddq);
  if (!mean.allFinite()) return TorqueStatus::kNotFinite;
  std::ranges::copy(mean, torque.begin());
  return TorqueStatus::kDone;
}

TorqueStatus TorqueEvaluator::mean_and_band(std::span<const double> q, std::span<const double> dq,
                                            std::span<const double> ddq, std::span<double> torque,
                                            std::span<double> half_width,
                                            TorqueBand band) noexcept {
  if (half_width.size() != joints()) return TorqueStatus::kBadArgument;
  const TorqueStatus status = mean(q, dq, ddq, torque);
  if (status != TorqueStatus::kDone) return status;
  const Eigen::VectorXd& sigma = state_->predictor.sigma();
  for (Index j = 0; j < sigma.size(); ++j) {
    half_width[static_cast<std::size_t>(j)] = state_->width(band, j) * sigma[j];
  }
  return status;
}

}  // namespace kinescope
