// SPDX-License-Identifier: Apache-2.0
//
// `kinescope predict`: a learned torque model on another log of the robot.
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "app/commands/commands.h"
#include "app/io/output_folder.h"
#include "app/io/torque_model_file.h"
#include "app/report/motion_words.h"
#include "app/report/result_values.h"
#include "app/torque/saved_model_log.h"
#include "app/torque/torque_inputs.h"
#include "dynamics/data/splits.h"
#include "kinematics/core/error.h"
#include "kinematics/core/file.h"

namespace kinescope {
namespace {

struct JudgedPrediction {
  TorqueSamples samples;
  TorquePrediction torque;
  BandFactors bands;
  bool traced = false;
  std::vector<std::string> warnings;
};

// Unit and sign of the log's torques against those that the model was learned from.
void check_scale(const std::vector<std::filesystem::path>& logs, JudgedPrediction& predicted) {
  std::vector<LogFinding> findings =
      compare_torque_scale(predicted.samples, predicted.torque.mean).findings;
  put_into_place(logs, findings);
  throw_refusals(findings);
  for (std::string& line : warnings_of(findings)) predicted.warnings.push_back(std::move(line));
}

JudgedPrediction predict(const PredictOptions& options, const TorqueModelFile& file) {
  JudgedPrediction out;
  TorqueData read = read_log_for(file, options.logs, options.data);
  out.warnings = warnings_of(read.findings);
  out.samples = std::move(read.samples);
  out.traced = file.traced.has_value();
  if (out.traced) {
    out.torque = predict_traced_torque(*file.traced, out.samples);
  } else {
    out.torque = predict_torque(file.model, out.samples.q, out.samples.dq, out.samples.ddq);
    out.bands = file.model.bands;
  }
  check_scale(options.logs, out);
  return out;
}

// t, trajectory, then of every joint: measured, mean, half the 90 % band, residual.
std::string table(const JudgedPrediction& predicted, const RigidModel& rigid) {
  std::string out = "t,trajectory";
  for (const RigidBody& body : rigid.bodies) {
    out += fmt::format(",torque_{0},mean_{0},band90_{0},residual_{0}", body.joint);
  }
  out += "\n";
  const TorqueSamples& samples = predicted.samples;
  for (Eigen::Index i = 0; i < samples.size(); ++i) {
    out += fmt::format("{},{}", samples.t_s[i], samples.trajectory[i]);
    for (Eigen::Index j = 0; j < samples.joints(); ++j) {
      const double mean = predicted.torque.mean(i, j);
      const double measured = samples.is_missing(i, j) ? std::nan("") : samples.torque(i, j);
      out +=
          fmt::format(",{:.9g},{:.9g},{:.9g},{:.9g}", measured, mean,
                      predicted.bands.width_90(j) * predicted.torque.sigma(i, j), measured - mean);
    }
    out += "\n";
  }
  return out;
}

struct JointResult {
  double nmse_percent = 0.0;
  double rms = 0.0;
  double within_90 = 0.0;
};

std::vector<JointResult> results(const JudgedPrediction& predicted) {
  const std::vector<Eigen::Index> rows = measured_rows(predicted.samples);
  const Eigen::MatrixXd measured = predicted.samples.torque(rows, Eigen::all);
  const Eigen::MatrixXd mean = predicted.torque.mean(rows, Eigen::all);
  const Eigen::MatrixXd sigma = predicted.torque.sigma(rows, Eigen::all);
  const Eigen::MatrixXd error = measured - mean;
  const Eigen::VectorXd nmse = normalised_error_percent(measured, mean);
  const auto count = static_cast<double>(error.rows());
  std::vector<JointResult> out;
  for (Eigen::Index j = 0; j < error.cols(); ++j) {
    const auto held =
        (error.col(j).array().abs() <= predicted.bands.width_90(j) * sigma.col(j).array()).count();
    out.push_back(
        {nmse[j], error.col(j).norm() / std::sqrt(count), static_cast<double>(held) / count});
  }
  return out;
}

// A model that knows the robot does better than the mean of the log; of another robot, load or
// kind of torque it does not.
std::string worse_words(const std::vector<JointResult>& joints, const RigidModel& rigid) {
  std::vector<std::string> worse;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (joints[j].nmse_percent > 100.0) worse.push_back(rigid.bodies[j].joint);
  }
  if (worse.empty()) return {};
  return fmt::format(
      "the model predicts {} of {} joints worse than a constant would ({}): is the log of the "
      "robot, "
      "the load and the kind of torque that it was learned from?",
      worse.size(), joints.size(), fmt::join(worse, ", "));
}

}  // namespace

ExitCode predict_command(const PredictOptions& options, const Console& console) {
  std::vector<std::filesystem::path> inputs = options.logs;
  inputs.push_back(options.model);
  require_folder_of(options.output);
  require_new_file(options.output, "--output", inputs, options.force);
  const TorqueModelFile file = read_torque_model(options.model);
  JudgedPrediction predicted = predict(options, file);
  if (measured_rows(predicted.samples).empty()) {
    throw bad_input(options.logs.front().string(),
                    "in no row the torques of all joints were measured (cut off, frozen, or in a "
                    "dead zone)",
                    "record within the range of every joint's torque");
  }
  const RigidModel& rigid = file.model.rigid;
  const std::vector<JointResult> joints = results(predicted);
  if (std::string words = worse_words(joints, rigid); !words.empty()) {
    predicted.warnings.push_back(std::move(words));
  }
  for (const std::string& warning : predicted.warnings) console.warn(warning);
  write_file_atomically(options.output, table(predicted, rigid));
  const std::vector<std::string> words = motion_words(file.model.learned, predicted.samples, rigid);
  if (console.json) {
    nlohmann::json document{{"model", to_string(file.model.kind)},
                            {"traced", predicted.traced},
                            {"samples", predicted.samples.size()},
                            {"unit", predicted.samples.torque_unit},
                            {"joints", nlohmann::json::array()},
                            {"motion", report::texts(words)},
                            {"warnings", report::texts(predicted.warnings)}};
    for (std::size_t j = 0; j < joints.size(); ++j) {
      document["joints"].push_back({{"name", report::text(rigid.bodies[j].joint)},
                                    {"nmse_percent", report::number(joints[j].nmse_percent)},
                                    {"rms", report::number(joints[j].rms)},
                                    {"within_90", report::number(joints[j].within_90)}});
    }
    console.print(document);
    return ExitCode::kDone;
  }
  fmt::print("The {} model{} of {}, learned from {} samples, on {} samples.\n",
             to_string(file.model.kind), predicted.traced ? " with what tracing found" : "",
             file.model.robot, file.model.samples, predicted.samples.size());
  fmt::print("{:<16} {:>10} {:>10} {:>16}\n", "joint", "nMSE, %",
             fmt::format("rms, {}", predicted.samples.torque_unit), "in 90 % band, %");
  for (std::size_t j = 0; j < joints.size(); ++j) {
    fmt::print(
        "{:<16} {:>10} {:>10.3g} {:>16.1f}\n", rigid.bodies[j].joint,
        std::isfinite(joints[j].nmse_percent) ? fmt::format("{:.3g}", joints[j].nmse_percent) : "-",
        joints[j].rms, 100.0 * joints[j].within_90);
  }
  for (const std::string& word : words) fmt::print("{}.\n", word);
  if (words.empty()) fmt::print("The motion stays within what was learned.\n");
  fmt::print("table   {}\n", options.output.string());
  return ExitCode::kDone;
}

}  // namespace kinescope
