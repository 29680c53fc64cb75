// SPDX-License-Identifier: Apache-2.0
#include "dynamics/effects/effect_motion.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "dynamics/data/statistics.h"
#include "dynamics/data/zero_phase_filter.h"
#include "dynamics/effects/first_order_lag.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

constexpr int kParts = 4;             // of a step of the samples, where they are filtered
constexpr double kEdgePeriods = 0.5;  // of the cut-off: the low-pass knows nothing beyond the ends
constexpr Eigen::Index kFewestRows = 12;  // that a trajectory must have

void check_sizes(const TorqueSamples& s) {
  const bool fits = s.q.rows() == s.size() && s.dq.rows() == s.size() && s.ddq.rows() == s.size() &&
                    s.torque.rows() == s.size() && s.trajectory.size() == s.size() &&
                    s.dq.cols() == s.joints() && s.ddq.cols() == s.joints() &&
                    s.torque.cols() == s.joints();
  if (fits && s.size() > 0 && s.joints() > 0) return;
  throw bad_request(
      "torque samples",
      fmt::format("the arrays are not all {} samples x {} joints", s.size(), s.joints()),
      "give positions, rates, accelerations and torques of the same joints");
}

int order_of(LowPass kind) { return kind == LowPass::kButterworth ? 4 : 3; }

/// Cubic Hermite between two samples, u from 0 to 1.
double hermite(double a, double b, double rate_a, double rate_b, double step_s, double u) {
  const double v = 1.0 - u;
  return v * v * (1.0 + 2.0 * u) * a + u * u * (3.0 - 2.0 * u) * b +
         u * v * step_s * (v * rate_a - u * rate_b);
}

}  // namespace

EffectMotion::EffectMotion(TorqueSamples samples, const EffectMotionOptions& options)
    : samples_(std::move(samples)), options_(options) {
  check_sizes(samples_);
  if (options_.filter.kind == LowPass::kNone || !(options_.filter.cutoff_hz > 0.0)) {
    options_.filter = {};
  } else {
    parts_ = kParts;
  }
  lay_out();
  choose_instants();
}

int EffectMotion::filter_order() const { return order_of(options_.filter.kind); }

void EffectMotion::lay_out() {
  clock_ = OneClock(samples_.t_s, samples_.trajectory);
  for (Eigen::Index row = 0; row < samples_.size(); ++row) {
    if (row == 0 || samples_.trajectory(row) != samples_.trajectory(row - 1)) {
      pieces_.push_back({row, 0, 0.0});
    }
    ++pieces_.back().rows;
  }
  for (Piece& piece : pieces_) {
    const auto t = samples_.t_s.segment(piece.begin, piece.rows);
    if (piece.rows > 1)
      piece.step_s = (t(piece.rows - 1) - t(0)) / static_cast<double>(piece.rows - 1);
  }
}

void EffectMotion::choose_instants() {
  if (options_.every_sample) {
    for (Eigen::Index row = 0; row < samples_.size(); ++row) kept_.push_back(row);
    return;
  }
  const bool filtered = options_.filter.cutoff_hz > 0.0;
  const double wanted_hz = options_.samples_per_cutoff * options_.filter.cutoff_hz;
  Eigen::Index stride = 1;
  if (filtered && pieces_.front().step_s > 0.0) {
    stride = std::max<Eigen::Index>(
        1, static_cast<Eigen::Index>(1.0 / (wanted_hz * pieces_.front().step_s) + 1e-6));
  }
  while (samples_.size() / stride > options_.most_instants) ++stride;
  for (const Piece& piece : pieces_) {
    if (piece.rows < kFewestRows) continue;
    Eigen::Index edge = 0;
    if (filtered && piece.step_s > 0.0) {
      edge = static_cast<Eigen::Index>(
          std::ceil(kEdgePeriods / (options_.filter.cutoff_hz * piece.step_s)));
    }
    for (Eigen::Index row = piece.begin + edge; row < piece.begin + piece.rows - edge;
         row += stride) {
      const bool finite = samples_.is_measured(row) && samples_.torque.row(row).allFinite() &&
                          samples_.q.row(row).allFinite() && samples_.dq.row(row).allFinite() &&
                          samples_.ddq.row(row).allFinite();
      if (finite) kept_.push_back(row);
    }
  }
}

FinePath EffectMotion::fine(const Piece& piece, const Eigen::VectorXd& weights) const {
  const Eigen::VectorXd q = samples_.q.middleRows(piece.begin, piece.rows) * weights;
  const Eigen::VectorXd dq = samples_.dq.middleRows(piece.begin, piece.rows) * weights;
  const Eigen::VectorXd ddq = samples_.ddq.middleRows(piece.begin, piece.rows) * weights;
  const Eigen::VectorXd t = time_s().segment(piece.begin, piece.rows);
  if (parts_ == 1) return {q.array(), dq.array(), ddq.array(), t.array()};
  const Eigen::Index count = (piece.rows - 1) * parts_ + 1;
  FinePath out{Eigen::ArrayXd(count), Eigen::ArrayXd(count), Eigen::ArrayXd(count),
               Eigen::ArrayXd(count)};
  for (Eigen::Index k = 0; k < count; ++k) {
    const Eigen::Index a = std::min(k / parts_, piece.rows - 2);
    const double u = static_cast<double>(k - a * parts_) / parts_;
    const double step_s = t(a + 1) - t(a);
    out.q(k) = hermite(q(a), q(a + 1), dq(a), dq(a + 1), step_s, u);
    out.dq(k) = hermite(dq(a), dq(a + 1), ddq(a), ddq(a + 1), step_s, u);
    out.ddq(k) = (1.0 - u) * ddq(a) + u * ddq(a + 1);
    out.time_s(k) = t(a) + u * step_s;
  }
  return out;
}

std::vector<FinePath> EffectMotion::fine_paths(const Eigen::VectorXd& weights) const {
  std::vector<FinePath> out;
  for (const Piece& piece : pieces_) {
    out.push_back(piece.rows < kFewestRows ? FinePath{} : fine(piece, weights));
  }
  return out;
}

Eigen::VectorXd EffectMotion::column_of(
    const std::vector<FinePath>& paths,
    const std::function<Eigen::ArrayXd(const FinePath&)>& torque) const {
  Eigen::VectorXd all = Eigen::VectorXd::Zero(samples_.size());
  for (std::size_t p = 0; p < pieces_.size(); ++p) {
    const Piece& piece = pieces_[p];
    if (piece.rows < kFewestRows) continue;
    Eigen::VectorXd values = torque(paths[p]).matrix();
    if (parts_ > 1) {
      values = filter_zero_phase(values, filter_order(), options_.filter.cutoff_hz,
                                 parts_ / piece.step_s);
    }
    for (Eigen::Index k = 0; k < piece.rows; ++k) all(piece.begin + k) = values(k * parts_);
  }
  return at_instants(all);
}

Eigen::VectorXd EffectMotion::column(
    const Eigen::VectorXd& weights,
    const std::function<Eigen::ArrayXd(const FinePath&)>& torque) const {
  return column_of(fine_paths(weights), torque);
}

Eigen::VectorXd EffectMotion::column(
    Eigen::Index joint, const std::function<Eigen::ArrayXd(const FinePath&)>& torque) const {
  const std::vector<FinePath>& paths =
      paths_.get(joint, [&] { return fine_paths(Eigen::VectorXd::Unit(joints(), joint)); });
  return column_of(paths, torque);
}

Eigen::VectorXd EffectMotion::at_instants(const Eigen::VectorXd& samples) const {
  return samples(kept_);
}

Eigen::MatrixXd EffectMotion::rows_at_instants(const Eigen::MatrixXd& samples) const {
  return samples(kept_, Eigen::all);
}

Eigen::VectorXd EffectMotion::rate(const Eigen::VectorXd& samples) const {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(samples.size());
  for (const Piece& piece : pieces_) {
    if (piece.rows < kFewestRows) continue;
    out.segment(piece.begin, piece.rows) =
        central_differences(samples.segment(piece.begin, piece.rows), piece.step_s);
  }
  return out;
}

Eigen::VectorXd EffectMotion::shifted(const Eigen::VectorXd& samples, double later_s) const {
  if (later_s == 0.0) return samples;
  const Eigen::VectorXd rates = rate(samples);
  Eigen::VectorXd out = samples;
  for (const Piece& piece : pieces_) {
    if (piece.rows < kFewestRows) continue;
    const double last = static_cast<double>(piece.rows - 1);
    for (Eigen::Index k = 0; k < piece.rows; ++k) {
      const double at = std::clamp(static_cast<double>(k) + later_s / piece.step_s, 0.0, last);
      const Eigen::Index a = piece.begin + std::min(static_cast<Eigen::Index>(at), piece.rows - 2);
      const double u = at - static_cast<double>(a - piece.begin);
      out(piece.begin + k) =
          hermite(samples(a), samples(a + 1), rates(a), rates(a + 1), piece.step_s, u);
    }
  }
  return out;
}

Eigen::VectorXd EffectMotion::lagged(const Eigen::VectorXd& samples, double constant_s) const {
  return first_order_lag(samples, time_s(), samples_.trajectory, constant_s);
}

Eigen::VectorXd EffectMotion::before_lag(const Eigen::VectorXd& samples, double constant_s) const {
  if (constant_s == 0.0) return samples;
  return samples + constant_s * rate(samples);
}

Eigen::MatrixXd EffectMotion::lagged_at_instants(const Eigen::MatrixXd& signals,
                                                 double constant_s) const {
  return first_order_lag(signals, at_instants(time_s()), samples_.trajectory(kept_), constant_s);
}

void EffectMotion::leave_out(const std::vector<char>& wanted) {
  std::erase_if(kept_,
                [&](Eigen::Index row) { return wanted[static_cast<std::size_t>(row)] == 0; });
}

}  // namespace kinescope
