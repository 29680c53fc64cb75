// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/several_joints.h"

#include <algorithm>
#include <cmath>

#include "kinematics/core/dense_algebra.h"
#include "kinematics/core/parallel_for.h"
#include "kinematics/structure/attachment_cost.h"
#include "kinematics/structure/screening.h"
#include "kinematics/structure/tangent.h"

namespace kinescope::structure_search {
namespace {

constexpr std::size_t kMostJoints = 8;
// Up to this many joints all orders are tried.
constexpr std::size_t kExhaustive = 4;
// Samples used while orders are compared.
constexpr std::size_t kMostFitted = 120;
// -2 ln likelihood by which another order has to be better than one nearer to the log's (odds of 1
// to 100).
constexpr double kClearlyLikelierOrder = 9.2;
// Standard deviations of a regression coefficient below which a channel does not matter.
constexpr double kSignificant = 6.0;
// Most that one sample may cost here: few postures may be all that shows a joint.
constexpr double kOutlier = 120.0;
// A coupling has to gain this much (-2 ln likelihood).
constexpr double kCouplingGain = 25.0;
// Cost a sample (6 expected) up to which a chain is good as it is. Not the variance alone: a joint
// swept by itself that does not fit looks like a few outliers.
constexpr double kGood = 7.5;

bool is_good(const ChainFit& fit) { return fit.cost < kGood * fit.samples; }

// The part of the problem that does not change with the order of the joints.
struct Problem {
  Motion motion;
  Eigen::MatrixXd readings;      // relative to the reference posture
  Eigen::VectorXd reference;     // readings there
  Pose T0;                       // child there
  std::vector<int> channels;     // that matter, in the log's order
  std::vector<Vector6d> twists;  // body twist of each at T0, per unit reading
  std::vector<double> rms;       // of the channels, in their own units
  double residual = 0.0;  // whitened variance that the linear model leaves near the reference
};

// The sample with the smallest sum of distances to all others (the home posture when joints move
// one by one); with `skip` > 0 the next ones that are a fair way off.
std::size_t central_sample(const Motion& motion, const Eigen::MatrixXd& readings,
                           const std::vector<int>& channels, int skip) {
  std::vector<std::pair<double, std::size_t>> sums;
  for (std::size_t i = 0; i < motion.size(); ++i) {
    double sum = 0.0;
    for (const MotionSample& other : motion) {
      double d = 0.0;
      for (const int c : channels)
        d += std::pow(readings(motion[i].instant, c) - readings(other.instant, c), 2);
      sum += std::sqrt(d);
    }
    sums.emplace_back(sum, i);
  }
  std::ranges::stable_sort(sums);
  return sums[std::min(sums.size() - 1, static_cast<std::size_t>(skip) * sums.size() / 8)].second;
}

std::vector<std::size_t> nearest_first(const Problem& p, const std::vector<int>& channels) {
  std::vector<double> distance;
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < p.motion.size(); ++i) {
    double d = 0.0;
    for (const int c : channels) d += std::pow(p.readings(p.motion[i].instant, c), 2);
    distance.push_back(d);
    order.push_back(i);
  }
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return distance[i]; });
  return order;
}

// Twists of all channels and their significance, from the samples near the reference.
void regress_twists(Problem& p, const std::vector<int>& channels) {
  const auto order = nearest_first(p, channels);
  const auto K = static_cast<Eigen::Index>(channels.size());
  const std::size_t wanted = std::max<std::size_t>(2 * channels.size() + 4, order.size() / 3);
  const std::size_t count = std::min(order.size(), wanted);
  Eigen::MatrixXd A(static_cast<Eigen::Index>(count), K + 1);
  Eigen::MatrixXd Y(static_cast<Eigen::Index>(count), 6);
  const Pose inverse = p.T0.inverse();
  for (std::size_t i = 0; i < count; ++i) {
    const MotionSample& s = p.motion[order[i]];
    const auto row = static_cast<Eigen::Index>(i);
    A(row, K) = 1.0;
    for (Eigen::Index k = 0; k < K; ++k)
      A(row, k) = p.readings(s.instant, channels[static_cast<std::size_t>(k)]);
    Y.row(row) = fast_log(inverse * s.pose).transpose();
  }
  Eigen::MatrixXd H = A.transpose() * A;
  H.diagonal().array() += 1e-4;
  const Eigen::MatrixXd covariance = LdltFactor(H).inverse();
  const Eigen::MatrixXd X = covariance * (A.transpose() * Y);
  const Eigen::MatrixXd residual = Y - A * X;
  const double dof = std::max(1.0, static_cast<double>(count) - static_cast<double>(K) - 1.0);
  const Eigen::VectorXd variance = residual.colwise().squaredNorm().transpose() / dof;
  const Matrix6d W = p.motion[order.front()].whitening;
  p.residual = (residual * W.transpose()).squaredNorm() / (6.0 * dof);
  for (Eigen::Index k = 0; k < K; ++k) {
    double strongest = 0.0;
    for (Eigen::Index c = 0; c < 6; ++c) {
      strongest =
          std::max(strongest,
                   std::abs(X(k, c)) / std::sqrt(std::max(1e-300, variance(c) * covariance(k, k))));
    }
    if (strongest < kSignificant) continue;
    p.channels.push_back(channels[static_cast<std::size_t>(k)]);
    p.twists.emplace_back(X.row(k).transpose());
  }
}

JointType type_of(const Vector6d& twist) {
  constexpr double kFarthest = 8.0;  // m: no joint turns about an axis further away
  return twist.tail<3>().norm() > kFarthest * twist.head<3>().norm() ? JointType::kPrismatic
                                                                     : JointType::kRevolute;
}

ChainJoint joint_of(const Problem& p, std::size_t k, const Vector6d& twist) {
  const JointType type = type_of(twist);
  ChainJoint joint = joint_from_twist(p.T0, twist, type);
  const double scale =
      type == JointType::kRevolute ? twist.head<3>().norm() : twist.tail<3>().norm();
  joint.terms = {{p.channels[k], scale}};
  return joint;
}

ChainModel start_model(const Problem& p, const std::vector<std::size_t>& order) {
  ChainModel model;
  for (const std::size_t k : order) model.joints.push_back(joint_of(p, k, p.twists[k]));
  model.mount = p.T0;
  return model;
}

// From the postures near the reference outwards, so that the start need only be right near it; and
// all at once, which wins where the start is good.
ChainFit fit_outwards(const Problem& p, ChainModel model, std::size_t most_samples) {
  const auto order = nearest_first(p, p.channels);
  const std::size_t stride = std::max<std::size_t>(1, order.size() / most_samples);
  ChainFit at_once;
  ChainFit fit;
  for (const double share : {1.0, 0.35, 0.65, 1.0}) {
    Motion part;
    const auto count = static_cast<std::size_t>(share * static_cast<double>(order.size()));
    for (std::size_t i = 0; i < count; i += stride) part.push_back(p.motion[order[i]]);
    if (part.size() < 2 * p.channels.size() + 4 && share < 1.0) continue;
    std::ranges::sort(part, {}, &MotionSample::instant);
    const bool first = at_once.samples == 0;
    fit = fit_chain(part, p.readings, model,
                    {.max_iterations = share < 1.0 ? 8 : 25, .most_cost = kOutlier});
    if (first) {
      at_once = fit;
      if (is_good(fit)) return fit;
    } else {
      model = fit.model;
    }
  }
  return fit.cost < at_once.cost ? fit : at_once;
}

struct Ordered {
  std::vector<std::size_t> order;
  ChainFit fit;
};

std::vector<std::vector<std::size_t>> insertions(const std::vector<std::size_t>& order) {
  std::vector<std::vector<std::size_t>> out;
  for (std::size_t from = 0; from < order.size(); ++from) {
    for (std::size_t to = 0; to < order.size(); ++to) {
      if (from == to || to + 1 == from) continue;
      auto next = order;
      next.erase(next.begin() + static_cast<std::ptrdiff_t>(from));
      next.insert(next.begin() + static_cast<std::ptrdiff_t>(to), order[from]);
      out.push_back(std::move(next));
    }
  }
  return out;
}

std::vector<std::vector<std::size_t>> all_orders(std::vector<std::size_t> order) {
  std::vector<std::vector<std::size_t>> out;
  while (std::ranges::next_permutation(order).found) out.push_back(order);
  return out;
}

// Best order, starting from the log's and leaving it only for a clear gain.
Ordered best_order(const Problem& p) {
  Ordered best;
  for (std::size_t k = 0; k < p.channels.size(); ++k) best.order.push_back(k);
  best.fit = fit_outwards(p, start_model(p, best.order), kMostFitted);
  const bool exhaustive = best.order.size() <= kExhaustive;
  for (int round = 0; round < (exhaustive ? 1 : 8); ++round) {
    Ordered next = best;
    auto orders = exhaustive ? all_orders(best.order) : insertions(best.order);
    std::vector<ChainFit> fits(orders.size());
    parallel_for(orders.size(), [&](std::size_t i) {
      fits[i] = fit_outwards(p, start_model(p, orders[i]), kMostFitted);
    });
    for (std::size_t i = 0; i < orders.size(); ++i) {
      if (fits[i].cost < next.fit.cost - kClearlyLikelierOrder)
        next = {std::move(orders[i]), std::move(fits[i])};
    }
    if (next.order == best.order) break;
    best = std::move(next);
  }
  return best;
}

// All couplings (joint a also moved by the channel of joint b), each tried at a ratio of -1, 0
// and 1.
ChainFit best_coupling(const Problem& p, const Ordered& now) {
  std::vector<ChainModel> models;
  for (std::size_t a = 0; a < now.order.size(); ++a) {
    for (std::size_t b = 0; b < now.order.size(); ++b) {
      if (a == b) continue;
      const std::size_t ka = now.order[a];
      const std::size_t kb = now.order[b];
      for (const double ratio : {-1.0, 0.0, 1.0}) {
        ChainModel model = now.fit.model;
        ChainJoint& joint = model.joints[a];
        const bool present = std::ranges::any_of(
            joint.terms, [&](const ChainTerm& t) { return t.channel == p.channels[kb]; });
        if (present) continue;
        if (ratio != 0.0) {
          model = start_model(p, now.order);
          const double step = ratio * p.rms[static_cast<std::size_t>(p.channels[kb])] /
                              p.rms[static_cast<std::size_t>(p.channels[ka])];
          const Vector6d left = p.twists[kb] - step * p.twists[ka];
          if (left.norm() < 1e-9) continue;
          model.joints[b] = joint_of(p, kb, left);
          model.joints[a].terms.push_back(
              {p.channels[kb], step * model.joints[a].terms.front().scale});
        } else {
          joint.terms.push_back({p.channels[kb], 0.0});
        }
        models.push_back(std::move(model));
      }
    }
  }
  std::vector<ChainFit> fits(models.size());
  parallel_for(models.size(), [&](std::size_t i) {
    fits[i] = fit_outwards(p, std::move(models[i]), kMostFitted);
  });
  ChainFit best = now.fit;
  for (ChainFit& fit : fits)
    if (fit.cost < best.cost) best = std::move(fit);
  return best;
}

// Readings count from their mean again: the chain at the reference posture goes into frames and
// mount.
ChainModel recentred(const ChainModel& model, const Eigen::VectorXd& reference) {
  ChainModel out = model;
  Pose shift;
  for (std::size_t k = 0; k < model.joints.size(); ++k) {
    const ChainJoint& joint = model.joints[k];
    double value = 0.0;
    for (const ChainTerm& t : joint.terms) value -= t.scale * reference(t.channel);
    const Pose motion = joint_motion(joint.type, Eigen::Vector3d::UnitZ(), value);
    const Pose D = joint.frame * motion * joint.frame.inverse();
    out.joints[k].frame = shift * joint.frame;
    shift = shift * D;
  }
  out.mount = shift * model.mount;
  return out;
}

ChainModel swapped(const ChainModel& model, std::size_t k) {
  ChainModel out = model;
  std::swap(out.joints[k], out.joints[k + 1]);
  return out;
}

// Neighbours in the chain whose order the data do not settle.
std::vector<OrderDoubt> order_doubts(const Problem& p, const ChainFit& fit) {
  std::vector<OrderDoubt> doubts;
  for (std::size_t k = 0; k + 1 < fit.model.joints.size(); ++k) {
    const ChainFit other = fit_chain(p.motion, p.readings, swapped(fit.model, k),
                                     {.max_iterations = 25, .most_cost = kOutlier});
    const double loss = other.cost - fit.cost;
    if (loss > 40.0) continue;
    doubts.push_back({fit.model.joints[k].terms.front().channel,
                      fit.model.joints[k + 1].terms.front().channel, std::max(0.0, loss)});
  }
  return doubts;
}

// Takes out joints whose loss costs less than they are worth.
ChainFit pruned(const Problem& p, ChainFit fit) {
  constexpr double kWorth =
      40.0;  // -2 ln likelihood, for five parameters and the choice of a channel
  for (std::size_t k = 0; k < fit.model.joints.size() && fit.model.joints.size() > 1;) {
    ChainModel model = fit.model;
    model.joints.erase(model.joints.begin() + static_cast<std::ptrdiff_t>(k));
    ChainFit without = fit_chain(p.motion, p.readings, std::move(model),
                                 {.max_iterations = 15, .most_cost = kOutlier});
    if (without.cost - fit.cost < kWorth) {
      fit = std::move(without);
      k = 0;
    } else {
      ++k;
    }
  }
  return fit;
}

// The chain with joint k, a turn, as the slide along which it moves the child from where it rests.
ChainModel with_slide(const ChainModel& model, std::size_t k) {
  ChainModel out = model;
  ChainJoint& joint = out.joints[k];
  const Eigen::Vector3d axis = joint.frame.rotation * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d step =
      axis.cross(Eigen::Vector3d(model.mount.translation - joint.frame.translation));
  joint.type = JointType::kPrismatic;
  joint.frame.rotation = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), step);
  for (ChainTerm& term : joint.terms) term.scale *= step.norm();
  return out;
}

// Turns about axes so far away that slides say as much are slides: near one posture the two look
// alike, and that is where the chain was started.
ChainFit with_plain_slides(const Problem& p, ChainFit fit, const Readings& readings) {
  constexpr double kTurned = 0.1;  // rad, RMS: what turns more is no slide
  for (std::size_t k = 0; k < fit.model.joints.size(); ++k) {
    const ChainJoint& joint = fit.model.joints[k];
    if (joint.type == JointType::kPrismatic || std::abs(joint.terms.front().scale) > kTurned)
      continue;
    ChainFit slide = fit_chain(p.motion, p.readings, with_slide(fit.model, k),
                               {.max_iterations = 25, .most_cost = kOutlier});
    const double loss = (slide.cost - fit.cost) / std::min(slide.correlation, fit.correlation) +
                        penalty_of(slide, readings) - penalty_of(fit, readings);
    if (loss < 0.0) fit = std::move(slide);
  }
  return fit;
}

std::optional<Problem> make_problem(const RelativeMotion& relative, const Readings& readings,
                                    const std::vector<char>& unused, int skip) {
  std::vector<int> channels;
  for (int c = 0; c < readings.channels(); ++c) {
    if (unused[static_cast<std::size_t>(c)] != 0) channels.push_back(c);
  }
  std::ranges::sort(channels, {},
                    [&](int c) { return readings.log_channel[static_cast<std::size_t>(c)]; });
  if (readings.last_joint_first) std::ranges::reverse(channels);
  if (channels.size() < 2 || relative.motion.size() < 4 * channels.size()) return std::nullopt;
  Problem p;
  p.rms = readings.rms;
  p.motion = relative.motion;
  const MotionSample& centre = p.motion[central_sample(p.motion, readings.value, channels, skip)];
  p.reference = readings.value.row(centre.instant).transpose();
  p.readings = readings.value.rowwise() - p.reference.transpose();
  p.T0 = centre.pose;
  regress_twists(p, channels);
  if (p.channels.size() < 2 || p.channels.size() > kMostJoints) return std::nullopt;
  return p;
}

}  // namespace

SerialOutlook serial_outlook(const Body& body, const LinkPath& path, const Readings& readings,
                             const std::vector<char>& unused) {
  const auto p = make_problem(relative_motion(body, path, readings), readings, unused, 0);
  if (!p) return {};
  return {static_cast<int>(p->channels.size()), p->residual};
}

std::optional<Attachment> find_serial_attachment(const Body& body, int parent, const LinkPath& path,
                                                 const Readings& readings,
                                                 const std::vector<char>& unused) {
  constexpr int kReferences = 4;
  const RelativeMotion relative = relative_motion(body, path, readings);
  std::optional<Attachment> best;
  for (int skip = 0; skip < kReferences; ++skip) {
    const auto p = make_problem(relative, readings, unused, skip);
    if (!p) continue;
    Ordered ordered = best_order(*p);
    for (std::size_t n = 0; n < p->channels.size() && !is_good(ordered.fit); ++n) {
      ChainFit coupled = best_coupling(*p, ordered);
      if (ordered.fit.cost - coupled.cost < kCouplingGain) break;
      ordered.fit = std::move(coupled);
    }
    ChainFit fit = pruned(*p, fit_chain(p->motion, p->readings, ordered.fit.model,
                                        {.max_iterations = 25, .most_cost = kOutlier}));
    if (fit.model.joints.size() < 2) continue;
    fit = with_plain_slides(*p, std::move(fit), readings);
    if (best && best->data_cost <= fit.cost) continue;
    std::vector<OrderDoubt> doubts = order_doubts(*p, fit);
    fit.model = recentred(fit.model, p->reference);
    best = attachment_from(std::move(fit), parent, relative, body, readings);
    best->order_doubts = std::move(doubts);
    if (is_good(best->fit)) break;
  }
  return best;
}

}  // namespace kinescope::structure_search
