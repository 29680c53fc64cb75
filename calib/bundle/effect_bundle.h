// SPDX-License-Identifier: Apache-2.0
//
// Takes   the same as calibrate().
// Gives   the bundle's fit with some effects in it, and how its residual answers to others: what
//         tracing needs. Sightings and their weights are the same in every fit.
// Method  Sightings that stand out from their neighbours in time are left out, whatever the model
//         says of them, and the noise is what differs between neighbours: an effect that the model
//         lacks neither loses its evidence as outliers nor passes for noise.
// Not here: what the effects are (calib/effects), the search (calib/trace).
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/SparseCore>

#include "calib/bundle/calibrate.h"

namespace kinescope {

/// What a fit has beyond the plain model, or lacks of it.
struct BundleChange {
  std::vector<Correction> corrections;
  bool time_offset = false;
  std::vector<std::size_t> without_couplings;  ///< of EffectBundle::couplings()
};

struct BundleCamera {
  std::string name;  ///< empty where there is one
  CameraModel model;
};

/// A joint that another one's channel moves, too, in the plain model.
struct DesignCoupling {
  int joint = 0;
  int other = 0;       ///< joint; the first that the channel drives
  double ratio = 0.0;  ///< of the joints' values
};

namespace bundle {
struct End;
}

struct BundleSolution {
  bool converged = false;
  std::string reason;
  Eigen::VectorXd values;  ///< of the change's parameters: corrections, then the time offset
  double time_offset_s = 0.0;
  Eigen::MatrixXd ahead_s;  ///< frames x joints: joint-log time minus frame time
  double variance = 0.0;    ///< of a whitened row, priors' squares counted in
  /// As fitted; joints stand in their zeros where motion_at_frames() says 0.
  KinematicTree tree;
  /// For fit(), which then need not solve again.
  std::shared_ptr<const bundle::End> end;
};

/// A solution, and how its residual answers to the parameters and to probes.
struct BundleFit : BundleSolution {
  Eigen::VectorXd residual;  ///< rows, whitened: observed minus predicted
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>
      jacobian;  ///< rows x parameters, d predicted; the change's columns last
  /// The change's corrections that bear on a few frames of one fold each, which are not among
  /// those, and the same of them.
  std::vector<Eigen::Index> local_corrections;
  Eigen::SparseMatrix<double, Eigen::RowMajor> local;
  Eigen::VectorXd local_values;
  Eigen::VectorXd local_information;    ///< of their priors
  Eigen::MatrixXd prior_information;    ///< of the parameters; empty without priors
  Eigen::VectorXd prior_gradient;       ///< of half the priors' squares; empty likewise
  Eigen::SparseMatrix<double> probes;   ///< rows x probes, d predicted
  std::vector<Eigen::Index> first_row;  ///< of every instant, one past the last
  std::vector<int> frames;              ///< of every instant
  std::vector<int> series;              ///< rows: of one marker (body, point) and one camera
  Eigen::VectorXd unit;                 ///< rows: px or m of a whitened one; 0 for a pose's turn
  /// Rows: where in the image the corner is expected; NaN where that says nothing of the image (a
  /// marker at rest is at one place only). Empty: rows are no corners, or were mixed.
  Eigen::MatrixX2d place_px;
  double correlation_time_s = 0.0;
};

/// Joint values and rates at some instants, by the model's own idea of the channels' units.
struct JointMotion {
  std::vector<double> times_s;
  Eigen::MatrixXd value;  ///< instants x joints of the tree, rad or m
  Eigen::MatrixXd rate;
  Eigen::MatrixXd read_s = {};  ///< likewise: when each was read, by the log; empty: at times_s
  /// Of joints that have some (`Joint::copies`): what each says instead.
  std::map<int, std::vector<Eigen::VectorXd>> copies = {};
};

class EffectBundle {
 public:
  /// `start.corrections`: effects that are known, beside which the sightings are chosen; the model
  /// begins without them. Throws as calibrate().
  EffectBundle(const Measurements& measurements, const MarkerSet& markers, const JointLog& log,
               const CalibrationStart& start, const CalibrateOptions& options);
  ~EffectBundle();
  EffectBundle(const EffectBundle&) = delete;
  EffectBundle& operator=(const EffectBundle&) = delete;

  /// Begins where the best of earlier ones ended that fits, and where it ends later ones may begin.
  [[nodiscard]] BundleSolution solve(const BundleChange& change) const;
  /// Shares of corrections and probes have one entry a frame of the measurements. `solved`: of this
  /// change, where it is known.
  [[nodiscard]] BundleFit fit(const BundleChange& change, const std::vector<Correction>& probes,
                              const BundleSolution* solved = nullptr) const;
  /// Of every frame, squares (in noises) of how far its sightings are from where they are expected
  /// with the values of a solution. Those that are left out count as well; each of either kind
  /// misses by no more than one just kept. `change`: as solved, but for shares.
  [[nodiscard]] Eigen::VectorXd squares_of_frames(const BundleChange& change,
                                                  const BundleSolution& solved) const;
  /// What a sighting costs at the most there.
  [[nodiscard]] double most_of_a_sighting() const;

  /// The plain model's start: tree with the units of the channels.
  [[nodiscard]] const KinematicTree& tree() const;
  [[nodiscard]] MeasurementKind kind() const;
  /// The reference camera first.
  [[nodiscard]] std::vector<BundleCamera> cameras() const;
  /// Of a camera on the robot, the link that carries it; 0: it stands still, or is carried.
  [[nodiscard]] LinkId camera_link() const;
  /// A person carries the camera: its pose in every frame is free.
  [[nodiscard]] bool is_camera_carried() const;
  /// Of every frame; empty: there is one camera.
  [[nodiscard]] const std::vector<int>& camera_of_frame() const;
  /// Cameras are of recordings of their own.
  [[nodiscard]] bool of_recordings() const;
  /// By how much corners are off in ways that repeat, as markers at rest show it; 0 without one.
  [[nodiscard]] double corner_bias_px() const;
  /// Standard deviation of the frames' stamps about the log's clock; 0 where it does not show.
  [[nodiscard]] double stamp_jitter_s() const;
  /// Postures at rest, each on its own: no clock, no motion.
  [[nodiscard]] bool postures() const;
  /// A fold for every frame, by posture; -1 for frames without a sighting.
  [[nodiscard]] const std::vector<int>& fold_of_frame() const;
  /// Of the plain model, where it is free.
  [[nodiscard]] double start_time_offset_s() const;
  /// Frames x joints: joint-log time minus frame time by that offset, and by the lags of cameras
  /// beside the reference camera.
  [[nodiscard]] Eigen::MatrixXd clock_ahead(double time_offset_s) const;
  /// What the frames show, read at their times and that much later: of all joints, or frames x
  /// joints. By the frames' own times.
  [[nodiscard]] JointMotion motion_at_frames(double time_offset_s) const;
  [[nodiscard]] JointMotion motion_at_frames(const Eigen::MatrixXd& ahead_s) const;
  /// The log's own samples, from the first to the last frame and a little beyond; all of them
  /// where none are there.
  [[nodiscard]] JointMotion motion_of_log(double time_offset_s) const;
  /// Joints that a channel drives.
  [[nodiscard]] std::vector<int> driven_joints() const;
  /// Those of them that move, whatever one reading says.
  [[nodiscard]] std::vector<int> moving_joints() const;
  /// Those of channels that drive a joint themselves.
  [[nodiscard]] const std::vector<DesignCoupling>& couplings() const;
  /// The same sightings are used.
  [[nodiscard]] bool chose_as(const EffectBundle& other) const;
  /// How many times larger the noise of a marker's sightings is there than here: of the marker of
  /// which it is most, the geometric mean.
  [[nodiscard]] double finer_than(const EffectBundle& other) const;
  /// Markers (index into the tree) that are seen.
  [[nodiscard]] std::vector<int> seen_markers() const;
  /// Of each of them, the cameras that see it.
  [[nodiscard]] std::map<int, std::vector<int>> cameras_of_markers() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace kinescope
