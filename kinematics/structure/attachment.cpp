// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/attachment.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>

#include "kinematics/structure/coupling.h"
#include "kinematics/structure/linear_motion.h"
#include "kinematics/structure/tangent.h"

namespace kinescope::structure_search {
namespace {

// A channel is inexact (backlash, gear error) when the residual along the joint is this much
// larger.
constexpr double kInexact = 1.5;
// Candidates this much worse (-2 ln likelihood, linear) than the best refined one are not refined.
constexpr double kHopeless = 60.0;

double log_det_of(const Matrix6d& W) {
  double sum = 0.0;
  for (int c = 0; c < 6; ++c) sum += std::log(std::abs(W(c, c)));
  return -2.0 * sum;
}

// Of a coordinate about its mean or, where neighbouring samples tell more, about the sample before
// (half the mean square step: the same for white noise, far less for a smooth motion).
double coordinate_variance(const ChainModel& model) {
  const auto n = static_cast<double>(model.coordinates.size());
  double mean = 0.0;
  for (const double c : model.coordinates) mean += c / n;
  double variance = 0.0;
  double steps = 0.0;
  double previous = model.coordinates.front();
  for (const double c : model.coordinates) {
    variance += (c - mean) * (c - mean) / n;
    steps += (c - previous) * (c - previous) / (2.0 * n);
    previous = c;
  }
  return std::min(variance, steps);
}

// Distance of the child from the axis; 0 for slides.
double axis_distance(const ChainModel& model) {
  if (model.joints.size() != 1 || model.joints.front().type != JointType::kRevolute) return 0.0;
  const Eigen::Vector3d p = model.joints.front().frame.inverse() * model.mount.translation;
  return p.head<2>().norm();
}

double penalty_of(const ChainFit& fit, const Readings& readings) {
  const double samples = std::max(2.0, fit.samples / fit.correlation);
  double penalty = 0.0;
  int free_parameters = fit.parameters;
  std::size_t t = 0;
  for (const ChainJoint& joint : fit.model.joints) {
    for (std::size_t k = 0; k < joint.terms.size(); ++k, ++t) {
      const ChainTerm& term = joint.terms[k];
      const double rms = readings.rms[static_cast<std::size_t>(term.channel)];
      --free_parameters;
      penalty +=
          scale_penalty(term.scale / rms, fit.scale_sigma[t] * std::sqrt(fit.correlation) / rms,
                        readings.si_share, rms);
      // Which channel drives the joint is one choice of many.
      if (k == 0) penalty += 2.0 * std::log(std::max(1, readings.channels()));
      // Couplings are rare (1 joint in 100), and which channel couples is one choice of many.
      if (k > 0) penalty += 2.0 * std::log(100.0 * std::max(2, readings.channels()));
    }
  }
  const double r = axis_distance(fit.model);
  penalty += 3.0 * std::log1p(r * r);
  return penalty + free_parameters * std::log(samples);
}

// What a coordinate free at every sample costs: it could have been anywhere in its range.
double coordinate_cost(const ChainFit& fit, const Motion& motion) {
  if (fit.model.joints.size() != 1 || !fit.model.joints.front().terms.empty()) return 0.0;
  const double variance = coordinate_variance(fit.model);
  double sum = 0.0;
  const Vector6d axis = axis_in_child(fit.model, 0.0);
  for (const MotionSample& s : motion) {
    const double lever = (s.whitening.triangularView<Eigen::Upper>() * axis).norm();
    sum += 1.0 + std::log1p(variance * lever * lever);
  }
  return sum;
}

// Arm (m) at which rotations are compared with translations.
constexpr double kLever = 0.3;

double motion_size(const Motion& motion) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  const auto n = static_cast<double>(motion.size());
  for (const MotionSample& s : motion) mean += s.pose.translation / n;
  const Eigen::Quaterniond middle = motion[motion.size() / 2].pose.rotation.conjugate();
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  double squared = 0.0;
  for (const MotionSample& s : motion) {
    const Eigen::Vector3d w = log_rotation(middle * s.pose.rotation);
    turn += w / n;
    squared += ((s.pose.translation - mean).squaredNorm() + kLever * kLever * w.squaredNorm()) / n;
  }
  return std::sqrt(std::max(0.0, squared - kLever * kLever * turn.squaredNorm()));
}

Attachment complete(ChainFit fit, const RelativeMotion& relative, int seen,
                    const Readings& readings) {
  Attachment a;
  const double share =
      relative.motion.empty() ? 1.0 : seen / static_cast<double>(relative.motion.size());
  a.data_cost = share * (fit.cost + relative.log_det + coordinate_cost(fit, relative.motion));
  a.penalty = penalty_of(fit, readings);
  a.motion_size = relative.motion.empty() ? 0.0 : motion_size(relative.motion);
  a.fit = std::move(fit);
  return a;
}

int seen_with_log(const Body& body, const Readings& readings) {
  int count = 0;
  for (std::size_t i = 0; i < body.at.size(); ++i)
    count += body.at[i].seen && readings.valid[i] != 0 ? 1 : 0;
  return count;
}

// Fits with the weight along the joint that its inexactness asks for.
ChainFit fit_weighted(const Motion& motion, const Readings& readings, const ChainModel& start) {
  ChainFit fit = fit_chain(motion, readings.value, start);
  if (fit.axis_variance > 2.0 * kInexact) {
    ChainFit again =
        fit_chain(motion, readings.value, fit.model, {.axis_weight = 1.0 / fit.axis_variance});
    if (again.cost < fit.cost) fit = std::move(again);
  }
  return fit;
}

}  // namespace

double Attachment::explained_ratio() const {
  // A fifth of the noise at least: less cannot be seen.
  const double excess = std::sqrt(std::max(0.04, 1.0 - 1.0 / fit.variance));
  const double left = std::hypot(fit.translation_rms, kLever * fit.rotation_rms) * excess;
  return motion_size / std::max(left, 1e-12);
}

double scale_penalty(double scale, double sigma, double si_share, double rms) {
  constexpr double kLogRange = 25.0;  // natural logarithms that any scale may lie within
  constexpr double kDegree = std::numbers::pi / 180.0;
  constexpr double kMillimetre = 1e-3;
  const double size = std::abs(scale);
  const double s = std::max(sigma, 1e-12);
  const double width =
      std::min(1.0, s * std::sqrt(2.0 * std::numbers::pi) / std::max(size, 1e-300) / kLogRange);
  const double other = 0.25 * (1.0 - si_share);
  double best = -2.0 * std::log(2.0 * other * width);
  const auto consider = [&](double unit, double share) {
    const double z = (size - unit) / std::hypot(s, 0.004 * unit);
    best = std::min(best, z * z - 2.0 * std::log(share));
  };
  consider(1.0, si_share);
  if (rms > 0.3) consider(kDegree, other);
  if (rms > 1.0) consider(kMillimetre, other);
  return best;
}

RelativeMotion relative_motion(const Body& body, const LinkPath& path, const Readings& readings) {
  RelativeMotion out;
  for (std::size_t i = 0; i < body.at.size(); ++i) {
    const Sighting& s = body.at[i];
    if (!s.seen || path.valid[i] == 0 || readings.valid[i] == 0) continue;
    const Pose inverse = path.pose[i].inverse();
    MotionSample sample{.instant = static_cast<int>(i),
                        .pose = inverse * s.pose,
                        .whitening = s.whitening,
                        .alternative = {},
                        .alternative_cost = s.alternative_cost};
    if (s.alternative) sample.alternative = inverse * *s.alternative;
    if (!path.covariance.empty()) {
      const Matrix6d ad = adjoint(sample.pose.inverse());
      sample.whitening = whitening_of(s.covariance + ad * path.covariance[i] * ad.transpose());
      out.log_det += log_det_of(sample.whitening) - log_det_of(s.whitening);
    }
    out.motion.push_back(std::move(sample));
  }
  return out;
}

Attachment attachment_from(ChainFit fit, int parent, const RelativeMotion& relative,
                           const Body& body, const Readings& readings) {
  Attachment a = complete(std::move(fit), relative, seen_with_log(body, readings), readings);
  a.parent = parent;
  return a;
}

namespace {

// Share of a free coordinate's variance that the channel which drives it explains, at least.
constexpr double kFollows = 0.5;

struct CoordinateFit {
  int channel = -1;
  double slope = 0.0;
  double zero = 0.0;
  double explained = kFollows;
};

// Coordinates regressed on every channel; a second pass leaves out what lies far from the line.
void regress_coordinates(const Eigen::VectorXd& y, const Motion& motion, const Readings& readings,
                         const std::vector<char>& usable, CoordinateFit& best) {
  const Eigen::Index n = y.size();
  for (int c = 0; c < readings.channels(); ++c) {
    if (usable[static_cast<std::size_t>(c)] == 0) continue;
    Eigen::VectorXd q(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      q(i) = readings.value(motion[static_cast<std::size_t>(i)].instant, c);
    }
    Eigen::VectorXd weight = Eigen::VectorXd::Ones(n);
    for (int pass = 0; pass < 2; ++pass) {
      const double total = weight.sum();
      const Eigen::VectorXd dq = q.array() - q.dot(weight) / total;
      const Eigen::VectorXd dy = y.array() - y.dot(weight) / total;
      const Eigen::VectorXd w = weight.cwiseProduct(dq);
      const double slope = w.dot(dy) / std::max(1e-300, w.dot(dq));
      Eigen::VectorXd squared = (dy - slope * dq).cwiseAbs2();
      const double variance = weight.dot(Eigen::VectorXd(dy.cwiseAbs2()));
      const double explained = 1.0 - weight.dot(squared) / std::max(1e-300, variance);
      if (explained > best.explained) {
        best = {c, slope, (y.dot(weight) - slope * q.dot(weight)) / total, explained};
      }
      const double median = median_of({squared.data(), squared.data() + n});
      weight = (squared.array() > 25.0 * median / 0.4549).select(0.0, Eigen::VectorXd::Ones(n));
    }
  }
}

// Angles within half a turn of their mean direction.
Eigen::VectorXd within_a_turn(const Eigen::VectorXd& angle) {
  const double mean = std::atan2(angle.array().sin().sum(), angle.array().cos().sum());
  const double turn = 2.0 * std::numbers::pi;
  return angle.array() - turn * ((angle.array() - mean) / turn).round();
}

// A joint with free coordinates as its best channel would drive it; nothing when none goes with
// them. Angles between few and fast samples may have been counted a turn off.
std::optional<Candidate> driven_by_best_channel(const ChainModel& free, const Motion& motion,
                                                const Readings& readings,
                                                const std::vector<char>& usable) {
  const ChainJoint& joint = free.joints.front();
  const Eigen::VectorXd y = Eigen::Map<const Eigen::VectorXd>(
      free.coordinates.data(), static_cast<Eigen::Index>(free.coordinates.size()));
  CoordinateFit fit;
  regress_coordinates(y, motion, readings, usable, fit);
  if (joint.type == JointType::kRevolute) {
    regress_coordinates(within_a_turn(y), motion, readings, usable, fit);
  }
  if (fit.channel < 0) return std::nullopt;
  Candidate out;
  out.channel = fit.channel;
  out.start = free;
  out.start.coordinates.clear();
  out.start.joints.front().terms = {{fit.channel, fit.slope}};
  const Pose shift = joint_motion(joint.type, Eigen::Vector3d::UnitZ(), fit.zero);
  out.start.mount = joint.frame * shift * joint.frame.inverse() * free.mount;
  return out;
}

// Refines candidates of one body and one link, and keeps them.
class Refiner {
 public:
  Refiner(const Body& body, int parent, const RelativeMotion& relative, const Readings& readings,
          const std::vector<char>& usable)
      : relative_(relative),
        readings_(readings),
        usable_(usable),
        parent_(parent),
        seen_(seen_with_log(body, readings)) {}

  void refine(const Candidate& candidate) {
    ChainFit fit = fit_weighted(relative_.motion, readings_, candidate.start);
    if (candidate.channel >= 0) {
      fit = with_couplings(std::move(fit), relative_.motion, readings_, usable_);
    } else if (!candidate.start.joints.empty()) {
      const auto driven = driven_by_best_channel(fit.model, relative_.motion, readings_, usable_);
      if (driven) refine(*driven);
    }
    Attachment a = complete(std::move(fit), relative_, seen_, readings_);
    best_ = std::min(best_, a.data_cost);
    a.parent = parent_;
    out_.push_back(std::move(a));
  }

  [[nodiscard]] double best() const { return best_; }
  [[nodiscard]] std::size_t count() const { return out_.size(); }

  [[nodiscard]] std::vector<Attachment> sorted() && {
    if (out_.empty()) return {};
    const auto by_data =
        std::ranges::min_element(out_, {}, [](const Attachment& a) { return a.data_cost; });
    const double correlation = by_data->fit.correlation;
    std::ranges::stable_sort(out_, {}, [&](const Attachment& a) { return a.cost(correlation); });
    return std::move(out_);
  }

 private:
  const RelativeMotion& relative_;
  const Readings& readings_;
  const std::vector<char>& usable_;
  int parent_ = 0;
  int seen_ = 0;
  double best_ = std::numeric_limits<double>::infinity();
  std::vector<Attachment> out_;
};

}  // namespace

std::vector<Attachment> find_attachments(const Body& body, int parent, const LinkPath& path,
                                         const Readings& readings, const std::vector<char>& usable,
                                         const AttachmentOptions& options) {
  const RelativeMotion relative = relative_motion(body, path, readings);
  const auto seen = static_cast<std::size_t>(seen_with_log(body, readings));
  if (relative.motion.size() < 5 || 3 * relative.motion.size() < seen) return {};
  const Screening screening =
      screen_motion(relative.motion, readings.value, usable,
                    {.coordinate_free = options.coordinate_free, .max_channels = 4});
  const double limit = options.give_up_above * static_cast<double>(relative.motion.size());
  Refiner refiner(body, parent, relative, readings, usable);
  for (const Candidate& candidate : screening.candidates) {
    const bool rest = candidate.start.joints.empty();
    const bool enough = static_cast<int>(refiner.count()) >= options.max_refined && !rest;
    const double hopeless = (rest ? 1.5 * refiner.best() : refiner.best()) + kHopeless;
    if (refiner.count() > 0 && (candidate.cost > hopeless || enough)) continue;
    if (options.give_up_above > 0.0 && candidate.cost > limit + kHopeless) continue;
    refiner.refine(candidate);
  }
  return std::move(refiner).sorted();
}

Attachment refit(const Attachment& attachment, const Body& body, const LinkPath& path,
                 const Readings& readings) {
  const RelativeMotion relative = relative_motion(body, path, readings);
  ChainModel start = attachment.fit.model;
  if (!attachment.at_rest() && !attachment.driven()) {
    // Free coordinates belong to samples: take them anew from the sightings.
    start.coordinates.assign(relative.motion.size(), 0.0);
    const Vector6d axis = axis_in_child(start, 0.0);
    for (std::size_t i = 0; i < relative.motion.size(); ++i) {
      double value = i > 0 ? start.coordinates[i - 1] : 0.0;
      for (int pass = 0; pass < 6; ++pass) {
        const Matrix6d& W = relative.motion[i].whitening;
        const Vector6d u = W * axis;
        const Vector6d r =
            W * fast_log(chain_pose_at(start, {value}).inverse() * relative.motion[i].pose);
        value += u.dot(r) / u.squaredNorm();
      }
      start.coordinates[i] = value;
    }
  }
  ChainFit fit = fit_weighted(relative.motion, readings, start);
  Attachment a = complete(std::move(fit), relative, seen_with_log(body, readings), readings);
  a.parent = attachment.parent;
  a.order_doubts = attachment.order_doubts;
  return a;
}

FreeCost free_cost(const Body& body, const Readings& readings) {
  const LinkPath camera = camera_path(static_cast<int>(body.at.size()));
  const RelativeMotion relative = relative_motion(body, camera, readings);
  if (relative.motion.empty()) return {};
  const LinearMotion linear = linear_motion(relative.motion);
  const double size = motion_size(relative.motion);
  Vector6d spread;
  spread << Eigen::Vector3d::Constant(size / kLever), Eigen::Vector3d::Constant(size);
  spread /= std::sqrt(6.0);
  FreeCost cost{free_motion_cost(linear), 0.0};
  for (const Matrix6d& W : linear.own) {
    const Matrix6d scaled = W * spread.asDiagonal();
    const Eigen::LLT<Matrix6d> factor(Matrix6d::Identity() + scaled * scaled.transpose());
    cost.everywhere += 6.0 + 2.0 * Matrix6d(factor.matrixL()).diagonal().array().log().sum();
  }
  return cost;
}

LinkPath camera_path(int instants) {
  LinkPath path;
  path.pose.assign(static_cast<std::size_t>(instants), Pose{});
  path.valid.assign(static_cast<std::size_t>(instants), 1);
  return path;
}

namespace {

// Where the last joint stands at one instant, and how well that is known.
struct Coordinate {
  double value = 0.0;
  double variance = 0.0;
};

// Of a single joint whose channel does not tell all: between what the channel says and what the
// sighting asks for, by their variances.
Coordinate corrected_coordinate(const Attachment& attachment, const Sighting& sighting,
                                const Pose& parent, double start) {
  const ChainModel& model = attachment.fit.model;
  const double excess = attachment.fit.axis_variance - 1.0;
  if (!sighting.seen) return {start, excess / 1e6};
  const Vector6d u = sighting.whitening * axis_in_child(model, 0.0);
  const double sight = 1.0 / u.squaredNorm();
  const double prior = excess * sight;
  const double gain = attachment.driven() ? prior / (prior + sight) : 1.0;
  const Pose seen = parent.inverse() * sighting.pose;
  const int passes = attachment.driven() ? 1 : 6;
  Coordinate out{start, gain * sight};
  for (int pass = 0; pass < passes; ++pass) {
    const Vector6d r =
        sighting.whitening * fast_log(chain_pose_at(model, {out.value}).inverse() * seen);
    out.value += gain * u.dot(r) * sight;
  }
  return out;
}

// Adds what the joints' parameters leave open about the path (right perturbations). What is
// constant in the link's frame does not count: the joints that follow take it up.
void add_parameter_doubt(const Attachment& attachment,
                         const std::vector<std::vector<double>>& coordinates,
                         const Readings& readings, LinkPath& path) {
  const ChainFit& fit = attachment.fit;
  if (fit.covariance.size() == 0) return;
  std::vector<Eigen::MatrixXd> jacobians(coordinates.size());
  Eigen::MatrixXd mean = Eigen::MatrixXd::Zero(6, fit.covariance.rows());
  double count = 0.0;
  for (std::size_t i = 0; i < coordinates.size(); ++i) {
    if (path.valid[i] == 0) continue;
    jacobians[i] = chain_jacobian(fit.model, coordinates[i], readings.value, static_cast<int>(i));
    mean += jacobians[i];
    count += 1.0;
  }
  mean /= std::max(1.0, count);
  for (std::size_t i = 0; i < coordinates.size(); ++i) {
    if (path.valid[i] == 0) continue;
    const Eigen::MatrixXd J = jacobians[i] - mean;
    path.covariance[i] += fit.correlation * (J * fit.covariance * J.transpose());
  }
}

}  // namespace

LinkPath path_of(const Attachment& attachment, const Body& body, const LinkPath& parent,
                 const Readings& readings) {
  const ChainModel& model = attachment.fit.model;
  const bool single = model.joints.size() == 1;
  const bool driven = attachment.driven();
  const bool inexact = single && (!driven || attachment.fit.axis_variance > kInexact);
  const std::size_t n = parent.pose.size();
  LinkPath path;
  path.pose.resize(n);
  path.valid.assign(n, 0);
  path.covariance.assign(n, Matrix6d::Zero());
  if (single && !driven) path.coordinate.assign(n, std::nan(""));
  const Vector6d axis = single ? axis_in_child(model, 0.0) : Vector6d::Zero();
  std::vector<std::vector<double>> coordinates(n);
  double previous = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    if (parent.valid[i] == 0 || readings.valid[i] == 0) continue;
    if (!driven && !body.at[i].seen) continue;
    std::vector<double>& values = coordinates[i];
    for (const ChainJoint& joint : model.joints) {
      values.push_back(driven ? chain_coordinate(joint, readings.value, static_cast<int>(i))
                              : previous);
    }
    if (inexact) {
      const Coordinate c =
          corrected_coordinate(attachment, body.at[i], parent.pose[i], values.front());
      values.front() = previous = c.value;
      path.covariance[i] = c.variance * axis * axis.transpose();
    }
    if (!driven) path.coordinate[i] = values.front();
    const Pose relative = chain_pose_at(model, values);
    path.valid[i] = 1;
    path.pose[i] = parent.pose[i] * relative;
    if (parent.covariance.empty()) continue;
    const Matrix6d ad = adjoint(relative.inverse());
    path.covariance[i] += ad * parent.covariance[i] * ad.transpose();
  }
  add_parameter_doubt(attachment, coordinates, readings, path);
  return path;
}

}  // namespace kinescope::structure_search
