// SPDX-License-Identifier: Apache-2.0
#include "kinematics/structure/attachment_path.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "kinematics/structure/chain_kinematics.h"
#include "kinematics/structure/tangent.h"

namespace kinescope::structure_search {
namespace {

// Where the last joint stands at one instant, and how well that is known.
struct Coordinate {
  double value = 0.0;
  double variance = 0.0;
};

// Of a single joint whose channel does not tell all: between what the channel says and what the
// sighting asks for, by their variances.
Coordinate corrected_coordinate(const Attachment& attachment, const ChainKinematics& chain,
                                const Sighting& sighting, const Pose& parent, double start) {
  const double excess = attachment.fit.axis_variance - 1.0;
  if (!sighting.seen) return {start, excess / 1e6};
  const Vector6d u = sighting.whitening * chain.last_axis();
  const double sight = 1.0 / u.squaredNorm();
  const double prior = excess * sight;
  const double gain = attachment.driven() ? prior / (prior + sight) : 1.0;
  const Pose seen = parent.inverse() * sighting.pose;
  const int passes = attachment.driven() ? 1 : 6;
  Coordinate out{start, gain * sight};
  for (int pass = 0; pass < passes; ++pass) {
    const Vector6d r = sighting.whitening * fast_log(chain.left_over(&out.value, seen));
    out.value += gain * u.dot(r) * sight;
  }
  return out;
}

// Adds what the joints' parameters leave open about the path (right perturbations). What is
// constant in the link's frame does not count: the joints that follow take it up.
void add_parameter_doubt(const ChainFit& fit, const ChainKinematics& chain,
                         const std::vector<std::vector<double>>& coordinates,
                         const Readings& readings, LinkPath& path) {
  if (fit.covariance.size() == 0) return;
  const Eigen::Index size = fit.covariance.rows();
  const auto instants = static_cast<Eigen::Index>(coordinates.size());
  // A sample's six rows of the Jacobian stand as columns, one sample after the other.
  Eigen::MatrixXd jacobians = Eigen::MatrixXd::Zero(size, 6 * instants);
  ChainJacobian J(6, size);
  ChainJacobian mean = ChainJacobian::Zero(6, size);
  double count = 0.0;
  for (Eigen::Index i = 0; i < instants; ++i) {
    const auto at = static_cast<std::size_t>(i);
    if (path.valid[at] == 0) continue;
    chain.jacobian(coordinates[at].data(), readings.value, static_cast<int>(i), J);
    jacobians.middleCols<6>(6 * i) = J.transpose();
    mean += J;
    count += 1.0;
  }
  mean /= std::max(1.0, count);
  const Eigen::MatrixXd mean_columns = mean.transpose();
  for (Eigen::Index i = 0; i < instants; ++i) jacobians.middleCols<6>(6 * i) -= mean_columns;
  const Eigen::LLT<Eigen::MatrixXd> factor(fit.correlation * fit.covariance);
  if (factor.info() != Eigen::Success) return;
  const Eigen::MatrixXd roots = factor.matrixU() * jacobians;
  for (Eigen::Index i = 0; i < instants; ++i) {
    const auto at = static_cast<std::size_t>(i);
    if (path.valid[at] == 0) continue;
    DoubtRoot& doubt = path.doubt[at];
    const Eigen::Index inherited = doubt.cols();
    doubt.conservativeResize(Eigen::NoChange, inherited + size);
    doubt.rightCols(size) = roots.middleCols<6>(6 * i).transpose();
  }
}

// A path of `instants` at which nothing is known yet.
LinkPath unknown_path(std::size_t instants) {
  LinkPath path;
  path.pose.resize(instants);
  path.valid.assign(instants, 0);
  path.covariance.assign(instants, Matrix6d::Zero());
  path.doubt.resize(instants);
  return path;
}

// Coordinates of all joints at one instant as the channels say; `previous` without channels.
std::vector<double> coordinates_at(const Attachment& attachment, const Readings& readings,
                                   std::size_t instant, double previous) {
  std::vector<double> values;
  for (const ChainJoint& joint : attachment.fit.model.joints) {
    values.push_back(attachment.driven()
                         ? chain_coordinate(joint, readings.value, static_cast<int>(instant))
                         : previous);
  }
  return values;
}

}  // namespace

LinkPath path_of(const Attachment& attachment, const Body& body, const LinkPath& parent,
                 const Readings& readings) {
  const ChainModel& model = attachment.fit.model;
  const bool single = model.joints.size() == 1;
  const bool driven = attachment.driven();
  const bool inexact = single && (!driven || attachment.fit.axis_variance > kInexact);
  const std::size_t n = parent.pose.size();
  LinkPath path = unknown_path(n);
  if (single && !driven) path.coordinate.assign(n, std::nan(""));
  const ChainKinematics chain(model);
  std::vector<std::vector<double>> coordinates(n);
  double previous = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    if (parent.valid[i] == 0 || readings.valid[i] == 0) continue;
    if (!driven && !body.at[i].seen) continue;
    std::vector<double>& values = coordinates[i];
    values = coordinates_at(attachment, readings, i, previous);
    if (inexact) {
      const Coordinate c =
          corrected_coordinate(attachment, chain, body.at[i], parent.pose[i], values.front());
      values.front() = previous = c.value;
      path.covariance[i] = c.variance * chain.last_axis() * chain.last_axis().transpose();
    }
    if (!driven) path.coordinate[i] = values.front();
    const Pose relative = chain.pose(values.data());
    path.valid[i] = 1;
    path.pose[i] = parent.pose[i] * relative;
    const Matrix6d ad = adjoint(relative.inverse());
    if (!parent.covariance.empty())
      path.covariance[i] += ad * parent.covariance[i] * ad.transpose();
    if (!parent.doubt.empty()) path.doubt[i] = ad * parent.doubt[i];
  }
  add_parameter_doubt(attachment.fit, chain, coordinates, readings, path);
  return path;
}

}  // namespace kinescope::structure_search
