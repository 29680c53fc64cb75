// SPDX-License-Identifier: Apache-2.0
//
// Corners and joint values in memory to a calibration: what app/examples/calibrate does with files.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include <fmt/format.h>
#include <pybind11/stl.h>

#include "app/explain/first_look.h"
#include "app/explain/pipeline.h"
#include "app/io/products.h"
#include "app/python/arrays.h"
#include "app/python/bindings.h"
#include "app/report/answer.h"
#include "calib/tracks/pose_tracks_from_tags.h"
#include "kinematics/core/error.h"
#include "kinematics/core/single_threaded_blas.h"

namespace kinescope::python {
namespace {

namespace py = pybind11;

constexpr Eigen::Index kCorners = 4;

void require_length(const std::string& name, Eigen::Index length, Eigen::Index wanted,
                    const std::string& of) {
  if (length == wanted) return;
  throw bad_request(name, fmt::format("has {} entries for {} {}", length, wanted, of),
                    "give one each");
}

std::vector<double> increasing(const Eigen::VectorXd& t, const std::string& name) {
  for (Eigen::Index i = 1; i < t.size(); ++i)
    if (!(t[i] > t[i - 1]))
      throw bad_request(fmt::format("{}[{}]", name, i), "does not increase", "sort by time");
  return {t.begin(), t.end()};
}

JointLog log_of(const py::dict& given) {
  JointLog out;
  out.source = "joint_values";
  out.channels = given["channels"].cast<std::vector<std::string>>();
  if (std::set(out.channels.begin(), out.channels.end()).size() != out.channels.size())
    throw bad_request("channels", "two have one name", "name each channel once");
  out.times_s = increasing(vector_of(given["joint_times"], "joint_times"), "joint_times");
  out.values = rows_of(given["joint_values"], "joint_values", std::ssize(out.channels));
  require_length("joint_values", out.values.rows(), std::ssize(out.times_s), "joint_times");
  return out;
}

MarkerSet markers_of(const py::dict& given) {
  MarkerSet out;
  const auto sizes = given["marker_sizes"].cast<std::map<int, double>>();
  for (const auto& [id, size] : sizes) {
    if (!(size > 0.0) || !std::isfinite(size))
      throw bad_request("marker_size", fmt::format("{} of marker {} is no length", size, id),
                        "give metres");
    out.sizes_m[TagId{id}] = size;
  }
  return out;
}

TagObservations observations_of(const py::dict& given) {
  const Eigen::VectorXd t = vector_of(given["frame_times"], "frame_times");
  const Eigen::VectorXi ids = integers_of(given["markers"], "markers");
  const Rows corners = rows_of(given["corners"], "corners", 2 * kCorners);
  const auto sigma_px = given["sigma_px"].cast<double>();
  if (!(sigma_px > 0.0) || !std::isfinite(sigma_px))
    throw bad_request("sigma_px", fmt::format("{} is no standard deviation", sigma_px),
                      "give one above 0");
  require_length("markers", ids.size(), corners.rows(), "sightings in corners");
  require_length("frame_times", t.size(), corners.rows(), "sightings in corners");
  TagObservations out;
  out.width = given["width"].cast<int>();
  out.height = given["height"].cast<int>();
  out.lens_known = !given["camera"].is_none();
  std::map<std::pair<double, int>, Eigen::Index> rows;  // by time, then marker
  for (Eigen::Index i = 0; i < t.size(); ++i) {
    if (ids[i] < 0)
      throw bad_request(fmt::format("markers[{}]", i), fmt::format("is {}", ids[i]),
                        "count from 0");
    if (!rows.try_emplace({t[i], ids[i]}, i).second)
      throw bad_request(fmt::format("corners[{}]", i),
                        fmt::format("shows marker {} at {} s a second time", ids[i], t[i]),
                        "give each sighting once");
  }
  for (const auto& [key, row] : rows) {
    if (out.times_s.empty() || out.times_s.back() < key.first) out.times_s.push_back(key.first);
    TagObservation seen;
    seen.frame = static_cast<int>(out.times_s.size()) - 1;
    seen.id = TagId{key.second};
    seen.sigma_px = sigma_px;
    for (Eigen::Index c = 0; c < kCorners; ++c)
      seen.corners_px.emplace_back(corners(row, 2 * c), corners(row, 2 * c + 1));
    out.observations.push_back(std::move(seen));
  }
  return out;
}

std::optional<CameraModel> camera_of(const py::dict& given) {
  if (given["camera"].is_none()) return std::nullopt;
  const py::dict camera = given["camera"];
  CameraModel out;
  out.width = given["width"].cast<int>();
  out.height = given["height"].cast<int>();
  const Rows K = rows_of(camera["K"], "camera.K", 3);
  if (K.rows() != 3 || !(K(0, 0) > 0.0) || !(K(1, 1) > 0.0))
    throw bad_request("camera.K", "is no camera matrix",
                      "give [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]");
  out.fx = K(0, 0), out.fy = K(1, 1), out.cx = K(0, 2), out.cy = K(1, 2);
  const auto word = camera["model"].cast<std::string>();
  const std::array models{DistortionModel::kPlumbBob, DistortionModel::kRationalPolynomial,
                          DistortionModel::kEquidistant};
  const auto model =
      std::ranges::find(models, word, [](DistortionModel m) { return to_string(m); });
  if (model == models.end())
    throw bad_request("camera.model", fmt::format("'{}' is no distortion model", word),
                      "plumb_bob, rational_polynomial or equidistant");
  out.model = *model;
  const Eigen::VectorXd terms = vector_of(camera["distortion"], "camera.distortion");
  require_length("camera.distortion", terms.size(), distortion_count(out.model),
                 "terms of " + word);
  std::ranges::copy(terms, out.distortion.begin());
  return out;
}

Recording recording_of(const py::dict& given) {
  Recording out;
  out.name = out.settings.name = given["name"].cast<std::string>();
  out.entry = RecordingEntry::kCorners;
  out.log = log_of(given);
  out.markers = markers_of(given);
  out.corners = observations_of(given);
  out.camera = camera_of(given);
  out.settings.units = given["units"].cast<std::map<std::string, std::string>>();
  for (const auto& [channel, unit] : out.settings.units)
    if (unit != "rad" && unit != "m" && unit != "ticks")
      throw bad_request("units", fmt::format("'{}' of {} is not known", unit, channel),
                        "rad, m or ticks");
  return out;
}

// As `kinescope run` judges it, too.
Calibration calibrated(const Recording& recording, const SightOptions& options) {
  RunSummary run;
  run.log = recording.log;
  const Observed observed = observe(recording, options, recording.camera, std::nullopt, {});
  require_time_overlap(recording.log, observed.measurements.times_s, "frame_times");
  const CameraModel camera = choose_camera(recording, observed.tags);
  const PoseTracks tracks = pose_tracks_from_tags(observed.tags, camera, recording.markers);
  std::optional<Structure> structure =
      require_plausible_motion(recording, tracks, options.calibrate);
  run.structure = structure ? as_robot(recording, *std::move(structure))
                            : find_robot(recording, tracks, options.calibrate);
  require_determined(*run.structure);
  run.calibration =
      calibrate(observed.measurements, recording.markers, recording.log,
                start_from_structure(*run.structure, recording, camera), options.calibrate);
  const Answer answer = judge(run);
  if (!answer.given) throw undetermined(answer.where, answer.what, answer.remedy);
  return std::move(run.calibration);
}

py::tuple calibrate_arrays(const py::dict& given, int folds, bool intrinsics, bool time_offset,
                           bool scales) {
  const Recording recording = recording_of(given);
  constexpr int kMostFolds = 50;  // as of the command
  if (folds < 0 || folds > kMostFolds)
    throw bad_request("folds", fmt::format("{} is out of range", folds), "0 to 50");
  SightOptions options;
  options.calibrate.folds = folds;
  options.calibrate.estimate_intrinsics = intrinsics || !recording.camera;
  options.calibrate.estimate_time_offset = time_offset;
  options.calibrate.estimate_scales = scales;
  std::string document, residuals;
  std::vector<std::string> warnings;
  {
    const py::gil_scoped_release unlocked;
    const SingleThreadedBlas same_bytes_on_any_number_of_cores;
    const Calibration found = calibrated(recording, options);
    nlohmann::json json = calibration_json(found);
    json["effects"] = nlohmann::json::array();
    document = json.dump();
    residuals = residuals_csv(found);
    warnings = found.warnings;
  }
  return py::make_tuple(document, residuals, warnings);
}

}  // namespace

void add_calibrate(py::module_& m) {
  m.def("calibrate", &calibrate_arrays, py::arg("given"), py::arg("folds"), py::arg("intrinsics"),
        py::arg("time_offset"), py::arg("scales"));
}

}  // namespace kinescope::python
