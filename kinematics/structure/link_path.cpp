// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/link_path.h"

#include <algorithm>
#include <cmath>

namespace kinescope::structure_search {
namespace {

// ln of the ratio of the determinants of the covariances that W and V whiten.
double log_det_ratio(const Matrix6d& W, const Matrix6d& V) {
  double ratio = 1.0;
  for (int c = 0; c < 6; ++c) ratio *= V(c, c) / W(c, c);
  return 2.0 * std::log(std::abs(ratio));
}

// Of a child's pose with this covariance in the frame of a parent with that one.
Matrix6d whitening_with(const Matrix6d& child, const Matrix6d& parent, const Pose& T_parent_child) {
  const Matrix6d ad = adjoint(T_parent_child.inverse());
  return whitening_of(child + ad * parent * ad.transpose());
}

bool is_exact(const LinkPath& path) { return path.covariance.empty() && path.doubt.empty(); }

}  // namespace

LinkPath camera_path(int instants) {
  LinkPath path;
  path.pose.assign(static_cast<std::size_t>(instants), Pose{});
  path.valid.assign(static_cast<std::size_t>(instants), 1);
  return path;
}

RelativeMotion relative_motion(const Body& body, const LinkPath& path, const Readings& readings,
                               int most) {
  std::vector<std::size_t> instants;
  instants.reserve(body.at.size());
  for (std::size_t i = 0; i < body.at.size(); ++i) {
    if (body.at[i].seen && path.valid[i] != 0 && readings.valid[i] != 0) instants.push_back(i);
  }
  const std::size_t keep = most > 0 ? static_cast<std::size_t>(most) : instants.size();
  const std::size_t stride = keep > 0 ? (instants.size() + keep - 1) / keep : 1;
  RelativeMotion out;
  out.motion.reserve(std::min(keep, instants.size()));
  const bool in_doubt =
      std::ranges::any_of(path.doubt, [](const DoubtRoot& root) { return root.cols() > 0; });
  for (std::size_t k = 0; k < instants.size(); k += stride) {
    const std::size_t i = instants[k];
    const Sighting& s = body.at[i];
    const Pose inverse = path.pose[i].inverse();
    MotionSample& sample = out.motion.emplace_back();
    sample.instant = static_cast<int>(i);
    sample.pose = inverse * s.pose;
    sample.whitening = s.whitening;
    sample.alternative_cost = s.alternative_cost;
    if (s.alternative) {
      sample.alternative = inverse * s.alternative->pose;
      sample.alternative_whitening = s.alternative->whitening;
    }
    if (is_exact(path)) continue;
    Matrix6d covariance = Matrix6d::Zero();
    Matrix6d own = s.whitening;
    if (!path.covariance.empty()) {
      covariance = path.covariance[i];
      if (!covariance.isZero(0.0)) own = whitening_with(s.covariance, covariance, sample.pose);
      out.log_det += log_det_ratio(own, s.whitening);
    }
    if (in_doubt) covariance += path.doubt[i] * path.doubt[i].transpose();
    sample.whitening = whitening_with(s.covariance, covariance, sample.pose);
    if (s.alternative) {
      sample.alternative_whitening =
          whitening_with(s.alternative->covariance, covariance, *sample.alternative);
    }
    if (!in_doubt) continue;
    const double more = log_det_ratio(sample.whitening, own);
    out.log_det += more;
    out.doubt_log_det += more;
    out.own_whitening.push_back(own);
    out.doubt.push_back(adjoint(sample.pose.inverse()) * path.doubt[i]);
  }
  return out;
}

int seen_with_log(const Body& body, const Readings& readings) {
  int count = 0;
  for (std::size_t i = 0; i < body.at.size(); ++i) {
    count += body.at[i].seen && readings.valid[i] != 0 ? 1 : 0;
  }
  return count;
}

}  // namespace kinescope::structure_search
