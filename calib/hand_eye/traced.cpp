// SPDX-License-Identifier: Apache-2.0
#include "calib/hand_eye/traced.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "kinematics/core/dense_algebra.h"

namespace kinescope::hand_eye {
namespace {

// Carriers in their order: twists of the camera, the scale, the time, shifts of the hand along the
// axes of the base, twists of every target.
constexpr int kCameraCarrier = 0;
constexpr int kScaleCarrier = 6;
constexpr int kClockCarrier = 7;
constexpr int kHandCarrier = 8;
constexpr int kTargetCarrier = 11;

const std::vector<EffectParameter> kTwist{{"turn x", "rad"}, {"turn y", "rad"}, {"turn z", "rad"},
                                          {"shift x", "m"},  {"shift y", "m"},  {"shift z", "m"}};

// One sighting's rows: shift, then turn given the shift, both of unit variance.
struct PoseRows {
  Vector6d residual;
  Eigen::MatrixXd jacobian;
  Eigen::MatrixXd carriers;
  double unit_m = 0.0;  ///< of the first three rows
};

// Cholesky by blocks. Shifts are whitened by the symmetric root, so that a row of unit length is
// `unit_m` whatever its direction, where the noise is alike in all of them.
Matrix6d pose_whitening(const Matrix6d& covariance, double& unit_m) {
  const Eigen::Matrix3d tt = covariance.bottomRightCorner<3, 3>();
  const Eigen::Matrix3d rt = covariance.topRightCorner<3, 3>();
  const SymmetricEigen shift = symmetric_eigen(tt);
  const Eigen::Matrix3d V = shift.vectors;
  const Eigen::Vector3d values = shift.values.cwiseMax(std::numeric_limits<double>::min());
  unit_m = std::sqrt(values.mean());
  const Eigen::Matrix3d by_shift = rt * V * values.cwiseInverse().asDiagonal() * V.transpose();
  const Eigen::MatrixXd turn = covariance.topLeftCorner<3, 3>() - by_shift * rt.transpose();
  const CholeskyFactor factor(turn);
  Matrix6d out = Matrix6d::Zero();
  out.block<3, 3>(0, 3) = V * values.cwiseSqrt().cwiseInverse().asDiagonal() * V.transpose();
  const auto whitened = [&](const Eigen::Matrix3d& m) {
    Eigen::Matrix3d w;
    for (Eigen::Index k = 0; k < 3; ++k) w.col(k) = factor.whitened(m.col(k));
    return w;
  };
  out.block<3, 3>(3, 0) = whitened(Eigen::Matrix3d::Identity());
  out.block<3, 3>(3, 3) = -whitened(by_shift);
  return out;
}

class SightingRows {
 public:
  SightingRows(const Model& model, const State& state, const Noise& noise)
      : model_(model), state_(state), noise_(noise) {}

  [[nodiscard]] std::vector<PoseRows> of(const Frame& frame, const FrameRows& rows) const {
    const FlangeAt flange = flange_at(model_, state_, frame);
    const Eigen::VectorXd weights = camera_weights(noise_, rows);
    std::vector<PoseRows> out;
    Eigen::Index row = 0;
    for (std::size_t s = 0; s < frame.sightings.size(); ++s) {
      const Eigen::Index n = rows.errors[s].residual.size();
      const Eigen::VectorXd w = weights.segment(row, n);
      out.push_back(of_sighting(frame.sightings[s].marker, rows.predicted[s], rows.errors[s],
                                rows.by_parameter.middleRows(row, n), w, flange));
      row += n;
    }
    return out;
  }

 private:
  [[nodiscard]] PoseRows of_sighting(int target, const Predicted& predicted,
                                     const bundle::SightingError& error,
                                     const Eigen::MatrixXd& by_parameter, const Eigen::VectorXd& w,
                                     const FlangeAt& flange) const {
    const Eigen::MatrixXd D = w.asDiagonal() * error.d_marker;
    Eigen::MatrixXd right(D.rows(), 1 + by_parameter.cols());
    right << -error.residual, by_parameter;
    const Eigen::MatrixXd solved = least_squares(D, w.asDiagonal() * right);
    const Matrix6d normal = D.transpose() * D;
    const Matrix6d covariance =
        inverse_of_positive(normal).value_or(Matrix6d::Identity()) +
        predicted.by_flange * noise_.flange_covariance() * predicted.by_flange.transpose();
    PoseRows out;
    const Matrix6d W = pose_whitening(covariance, out.unit_m);
    out.residual = W * solved.col(0);
    out.jacobian = W * solved.rightCols(by_parameter.cols());
    const auto targets = static_cast<Eigen::Index>(model_.data().targets.size());
    Eigen::MatrixXd carriers = Eigen::MatrixXd::Zero(6, kTargetCarrier + 6 * targets);
    carriers.middleCols<6>(kCameraCarrier) = predicted.by_camera;
    carriers.col(kScaleCarrier) = predicted.by_scale;
    carriers.col(kClockCarrier) = predicted.by_time;
    carriers.middleCols<3>(kHandCarrier) =
        predicted.by_flange.rightCols<3>() * flange.T_base_flange.matrix3().transpose();
    carriers.middleCols<6>(kTargetCarrier + 6 * target).setIdentity();
    out.carriers = W * carriers;
    return out;
  }

  const Model& model_;
  const State& state_;
  const Noise& noise_;
};

// Rows of all instants, gathered.
class Gathered {
 public:
  void add(const Frame& frame, const std::vector<PoseRows>& rows, int fold) {
    linear_.first_row.push_back(rows_);
    times_s_.push_back(frame.time_s);
    linear_.fold.push_back(fold);
    for (std::size_t s = 0; s < rows.size(); ++s) {
      for (Eigen::Index k = 0; k < 6; ++k) {
        units_.push_back(k < 3 ? rows[s].unit_m : 0.0);
        linear_.body.push_back(frame.sightings[s].marker);
      }
      parts_.push_back(rows[s]);
      rows_ += 6;
    }
  }

  [[nodiscard]] Linearisation linearisation(const Model& model) {
    linear_.first_row.push_back(rows_);
    linear_.residual.resize(rows_);
    linear_.jacobian.resize(rows_, model.parameters());
    const Eigen::Index carriers = parts_.empty() ? 0 : parts_.front().carriers.cols();
    linear_.carriers.resize(rows_, carriers);
    std::vector<Eigen::Triplet<double>> entries;
    for (std::size_t p = 0; p < parts_.size(); ++p) {
      const auto row = 6 * static_cast<Eigen::Index>(p);
      linear_.residual.segment<6>(row) = parts_[p].residual;
      linear_.jacobian.middleRows<6>(row) = parts_[p].jacobian;
      for (Eigen::Index i = 0; i < 6; ++i)
        for (Eigen::Index c = 0; c < carriers; ++c)
          if (parts_[p].carriers(i, c) != 0.0)
            entries.emplace_back(row + i, c, parts_[p].carriers(i, c));
    }
    linear_.carriers.setFromTriplets(entries.begin(), entries.end());
    linear_.unit =
        Eigen::Map<const Eigen::VectorXd>(units_.data(), static_cast<Eigen::Index>(units_.size()));
    linear_.time_s = Eigen::Map<const Eigen::VectorXd>(times_s_.data(),
                                                       static_cast<Eigen::Index>(times_s_.size()));
    linear_.unit_name = "m";
    linear_.coordinates = 3;
    linear_.independent_instants = model.data().postures;
    return linear_;
  }

 private:
  Linearisation linear_;
  std::vector<PoseRows> parts_;
  std::vector<double> units_;
  std::vector<double> times_s_;
  Eigen::Index rows_ = 0;
};

Candidate candidate(EffectId id, std::string words, std::vector<EffectParameter> parameters,
                    std::string unit) {
  Candidate out;
  out.id = std::move(id);
  out.words = std::move(words);
  out.size_weights = Eigen::VectorXd::Ones(static_cast<Eigen::Index>(parameters.size()));
  out.parameters = std::move(parameters);
  out.size_unit = std::move(unit);
  return out;
}

Candidate position_scale() {
  Candidate out = candidate({std::string(kPositionScale), "controller"},
                            "the controller's positions are too short by a share (or the markers' "
                            "declared size too large by it)",
                            {{"relative", "m/m"}}, "m/m");
  out.check =
      "the markers' printed size with a calliper; lengths and gear ratios in the controller";
  out.record = "move the hand over a longer way";
  // More is another unit or another target, and seen at once: a fit that asks for it bends to
  // something else (23 poses of a UR10 asked for 37 %).
  out.possible = [](const Eigen::VectorXd& share) {
    constexpr double kMost = 0.1;
    return std::abs(share[0]) < kMost;
  };
  out.columns = [](double) { return std::vector<EffectColumn>{{kScaleCarrier, {}}}; };
  return out;
}

Candidate time_offset() {
  Candidate out =
      candidate({std::string(kTimeOffset), "clock"},
                "the log's clock is ahead of the camera's, or behind", {{"offset", "s"}}, "s");
  out.check = "where images and poses get their stamps";
  out.record = "move faster, and in changing directions";
  out.columns = [](double) { return std::vector<EffectColumn>{{kClockCarrier, {}}}; };
  return out;
}

Candidate clock_drift(const Model& model, const Eigen::VectorXd& time_s) {
  Candidate out =
      candidate({std::string(kClockDrift), "clock"}, "one of the clocks runs faster than the other",
                {{"drift", "s/s"}}, "s/s");
  out.signed_words = {"the log's clock runs faster than the camera's",
                      "the log's clock runs slower than the camera's"};
  out.check = "which clocks stamp images and poses; declare the camera's frame rate if it is known";
  out.record = "record for longer";
  const Eigen::VectorXd since = time_s.array() - model.data().middle_s();
  out.columns = [since](double) { return std::vector<EffectColumn>{{kClockCarrier, since}}; };
  return out;
}

// Of the instants' times: those at which something may have happened once, some instants away
// from both ends.
std::vector<double> switching_times(const Eigen::VectorXd& time_s) {
  constexpr Eigen::Index kFewest = 3;  // poses before and after
  constexpr double kEnds = 0.06;       // of the recording
  constexpr Eigen::Index kMost = 120;
  const Eigen::Index n = time_s.size();
  const Eigen::Index ends =
      std::max(kFewest, static_cast<Eigen::Index>(kEnds * static_cast<double>(n)));
  std::vector<double> out;
  const Eigen::Index all = n - 2 * ends + 1;
  for (Eigen::Index k = 0; k < std::min(all, kMost); ++k)
    out.push_back(time_s[ends + k * all / std::min(all, kMost)]);
  return out;
}

void happens_once_at(const Model& model, const Eigen::VectorXd& time_s, int first_carrier,
                     Candidate& out) {
  out.size_weights.head<3>().setZero();
  out.scan = switching_times(time_s);
  out.scan_listed = true;
  out.scan_name = "at";
  out.scan_unit = "s";
  if (model.data().postures) {
    out.scan_words = [times_s = time_s](double at) {
      const auto first = std::ranges::lower_bound(times_s, at);
      return fmt::format("pose {} of {}", first - times_s.begin() + 1, times_s.size());
    };
  }
  out.columns = [times_s = time_s, first_carrier](double at) {
    const Eigen::VectorXd since = (times_s.array() >= at).cast<double>();
    std::vector<EffectColumn> columns;
    for (int k = 0; k < 6; ++k) columns.push_back({first_carrier + k, since});
    return columns;
  };
}

Candidate camera_bump(const Model& model, const Eigen::VectorXd& time_s) {
  const bool on_hand = model.hypothesis().mount == CameraMount::kOnHand;
  Candidate out = candidate(
      {std::string(kCameraBump), "camera"},
      on_hand ? "the camera moved on the hand" : "the camera (or the robot's base) was moved",
      kTwist, "m");
  out.check = on_hand ? "screws of the camera's bracket, collisions, cable pulls"
                      : "tripod, cable pulls, screws of the base";
  out.record = "go back to the first poses at the end";
  happens_once_at(model, time_s, kCameraCarrier, out);
  return out;
}

Candidate tag_slip(const Model& model, const Eigen::VectorXd& time_s, std::size_t target) {
  const std::string name = target_name(model.data().targets[target]);
  Candidate out =
      candidate({std::string(kTagSlip), name}, fmt::format("{} was moved", name), kTwist, "m");
  out.check = "glue or screws of the marker's plate, what it stands on";
  out.record = "go back to the first poses at the end";
  happens_once_at(model, time_s, kTargetCarrier + 6 * static_cast<int>(target), out);
  return out;
}

std::vector<Candidate> candidates_of(const Model& model, const Eigen::VectorXd& time_s,
                                     bool jumps) {
  std::vector<Candidate> out{position_scale()};
  if (!model.data().postures) {
    out.push_back(time_offset());
    out.push_back(clock_drift(model, time_s));
  }
  if (!jumps || switching_times(time_s).empty()) return out;
  out.push_back(camera_bump(model, time_s));
  for (std::size_t k = 0; k < model.data().targets.size(); ++k)
    out.push_back(tag_slip(model, time_s, k));
  return out;
}

std::vector<Covariate> covariates_of(const Model& model, const State& state,
                                     const std::vector<std::size_t>& used) {
  const auto n = static_cast<Eigen::Index>(used.size());
  std::vector<Covariate> out{{"time", "s", Eigen::VectorXd(n)},
                             {"x of the hand", "m", Eigen::VectorXd(n)},
                             {"y of the hand", "m", Eigen::VectorXd(n)},
                             {"z of the hand", "m", Eigen::VectorXd(n)}};
  for (Eigen::Index i = 0; i < n; ++i) {
    const Frame& frame = model.data().frames[used[static_cast<std::size_t>(i)]];
    out[0].value[i] = frame.time_s;
    const Eigen::Vector3d at = flange_at(model, state, frame).T_base_flange.translation;
    for (Eigen::Index k = 0; k < 3; ++k) out[static_cast<std::size_t>(1 + k)].value[i] = at[k];
  }
  return out;
}

}  // namespace

TracedHandEye::TracedHandEye(const Model& model, const Fit& fit, std::vector<int> fold, bool jumps)
    : model_(model), fit_(fit), fold_(std::move(fold)), jumps_(jumps) {}

TracedFit TracedHandEye::fit(const std::vector<AddedEffect>& effects) const {
  const Model with(model_.data(), model_.log(), model_.hypothesis(), effects);
  const Solved solved =
      solve(with, state_for(with, model_, fit_.state), fit_.noise, fit_.used, false);
  TracedFit out;
  out.converged = solved.converged;
  if (!out.converged) out.reason = "the fit did not converge";
  const SightingRows pose_rows(with, solved.state, fit_.noise);
  Gathered gathered;
  for (const std::size_t f : fit_.used) {
    const Frame& frame = with.data().frames[f];
    const auto rows = rows_of(with, solved.state, frame);
    if (!rows) {
      out.converged = false;
      out.reason = "a marker that was seen comes to lie behind the camera";
      continue;
    }
    gathered.add(frame, pose_rows.of(frame, *rows), fold_[f]);
  }
  out.linear = gathered.linearisation(with);
  Fit now = fit_;
  now.state = solved.state;
  now.rows = rows_of_all(with, solved.state);
  out.linear.correlation_time_s = correlation_time(with, now);
  for (std::size_t k = 0; k < effects.size(); ++k)
    out.values.push_back(effect_values(with, solved.state, k));
  out.candidates = candidates_of(with, out.linear.time_s, jumps_);
  out.covariates = covariates_of(with, solved.state, fit_.used);
  for (int k = 0; k < 3; ++k)
    out.rest_places.push_back({fmt::format("hand along {}", "xyz"[k]), "m", kHandCarrier + k});
  if (!model_.data().postures) out.clock = kClockCarrier;
  return out;
}

}  // namespace kinescope::hand_eye
