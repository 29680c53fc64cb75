// SPDX-License-Identifier: Apache-2.0
#include "app/torque/contact_predictor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/io/nearest_name.h"
#include "app/io/output_folder.h"
#include "app/report/motion_words.h"
#include "app/torque/contact_model.h"
#include "app/torque/model_of_robot.h"
#include "app/torque/torque_inputs.h"
#include "dynamics/data/splits.h"
#include "dynamics/data/torque_scale.h"
#include "kinematics/core/error.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

/// Those that SavedTorqueModel holds.
constexpr std::array kUsable = {TorqueModelKind::kParametric, TorqueModelKind::kRbf,
                                TorqueModelKind::kGip, TorqueModelKind::kSemiParametric};

std::vector<std::string> usable_names() {
  std::vector<std::string> out;
  for (const TorqueModelKind kind : kUsable) out.emplace_back(to_string(kind));
  return out;
}

TorqueModelKind usable_kind(const std::string& name) {
  const std::vector<std::string> names = usable_names();
  const auto kind = torque_model_kind(name);
  if (!kind) {
    throw bad_input(name, "there is no such file, nor such a torque model",
                    "give a file of kinescope dynamics --save-model; " + did_you_mean(name, names));
  }
  if (std::ranges::find(kUsable, *kind) == kUsable.end()) {
    throw bad_request("--model", fmt::format("{} models cannot be saved, nor be used here", name),
                      fmt::format("name {}", fmt::join(names, ", ")));
  }
  return *kind;
}

TorqueLog trajectory_of(const TorqueLog& log, int number) {
  std::vector<char> keep;
  for (const int own : log.trajectory) keep.push_back(own == number ? 1 : 0);
  return keep_rows(log, keep);
}

const TorqueFilter& filter_of(const TorqueModelFile& file) {
  return file.traced ? file.traced->filter : file.filter;
}

/// The model's own low-pass is part of what it learned.
void require_own_cutoff(const TorqueModelFile& file, double stated_hz, const fs::path& path) {
  constexpr double kRounding = 1e-6;  // as printed
  const double own_hz = filter_of(file).cutoff_hz;
  if (!(stated_hz > 0.0) || std::abs(stated_hz - own_hz) <= kRounding * own_hz) return;
  throw bad_request("--cutoff",
                    fmt::format("is {:.6g} Hz, {} was learned behind {:.6g} Hz", stated_hz,
                                path.string(), own_hz),
                    "leave it out (and cutoff_hz in recording.yaml), or learn the model with it");
}

MotionOptions motion_as_learned(const TorqueModelFile& file, const MotionOptions& given) {
  MotionOptions out = given;
  const TorqueFilter& filter = filter_of(file);
  out.filter = filter.kind;
  out.cutoff_hz = filter.cutoff_hz;
  out.edge_periods = 0.0;  // contacts often end a log
  return out;
}

/// Nothing of a motion shorter than the filter's memory.
std::optional<TorqueSamples> filtered_motion(const TorqueLog& trajectory,
                                             const MotionOptions& options) {
  try {
    return derive_motion(trajectory, options).samples;
  } catch (const Error& error) {
    if (error.code() != ExitCode::kUndetermined) throw;
    return std::nullopt;
  }
}

/// Friction of each joint: the part of its torque that is odd in its own rate, the others at rest.
/// With them in motion the products of rates would be odd, too.
Eigen::RowVectorXd friction_at(TorquePredictor& predictor, const Eigen::VectorXd& q,
                               const Eigen::VectorXd& dq) {
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(q.size());
  Eigen::VectorXd rate = none;
  Eigen::RowVectorXd out(q.size());
  for (Eigen::Index j = 0; j < q.size(); ++j) {
    rate[j] = dq[j];
    const double forward = predictor.mean(q, rate, none)[j];
    rate[j] = -dq[j];
    out[j] = 0.5 * (forward - predictor.mean(q, rate, none)[j]);
    rate[j] = 0.0;
  }
  return out;
}

/// `push`: of each joint, an acceleration of the size that the model learned. All models but the
/// squared exponential are linear in it.
Eigen::MatrixXd inertia_at(TorquePredictor& predictor, const Eigen::VectorXd& push,
                           const Eigen::VectorXd& q, const Eigen::VectorXd& dq,
                           Eigen::VectorXd ddq) {
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(q.size(), q.size());
  const Eigen::VectorXd mean = predictor.mean(q, dq, ddq);
  for (Eigen::Index j = 0; j < q.size(); ++j) {
    if (push[j] == 0.0) continue;
    const double acceleration = std::exchange(ddq[j], ddq[j] + push[j]);
    out.col(j) = (predictor.mean(q, dq, ddq) - mean) / push[j];
    ddq[j] = acceleration;
  }
  return out;
}

/// What the model says of a filtered motion; inertia as rows of one matrix.
struct FilteredPrediction {
  Eigen::MatrixXd mean, frictionless, sigma, inertia;
};

FilteredPrediction predict_filtered(const TorqueModelFile& file, const TorqueSamples& samples) {
  FilteredPrediction out;
  const TorquePrediction own = predict_torque(file.model, samples.q, samples.dq, samples.ddq);
  out.mean = own.mean;
  out.sigma = own.sigma;
  if (file.traced) {
    out.mean = predict_torque(file.traced->corrected, samples, file.traced->filter);
    out.sigma = file.traced->sigma.transpose().replicate(samples.size(), 1);
  }
  const Eigen::Index n = samples.joints();
  out.frictionless = out.mean;
  out.inertia.resize(samples.size(), n * n);
  TorquePredictor predictor(file.model);
  for (Eigen::Index t = 0; t < samples.size(); ++t) {
    const Eigen::VectorXd q = samples.q.row(t).transpose();
    const Eigen::VectorXd dq = samples.dq.row(t).transpose();
    out.frictionless.row(t) -= friction_at(predictor, q, dq);
    out.inertia.row(t) =
        inertia_at(predictor, file.model.learned.hardest, q, dq, samples.ddq.row(t).transpose())
            .reshaped()
            .transpose();
  }
  return out;
}

/// Column by column linear between the samples, held beyond the ends.
Eigen::MatrixXd interpolated(const Eigen::VectorXd& t_s, const Eigen::MatrixXd& values,
                             const Eigen::VectorXd& at_s) {
  Eigen::MatrixXd out(at_s.size(), values.cols());
  Eigen::Index k = 0;
  for (Eigen::Index i = 0; i < at_s.size(); ++i) {
    while (k + 2 < t_s.size() && t_s[k + 1] <= at_s[i]) ++k;
    const double share = std::clamp((at_s[i] - t_s[k]) / (t_s[k + 1] - t_s[k]), 0.0, 1.0);
    out.row(i) = (1.0 - share) * values.row(k) + share * values.row(k + 1);
  }
  return out;
}

/// Speeds that accelerations lead to from the first one on.
Eigen::MatrixXd integrated(const Eigen::VectorXd& t_s, const Eigen::RowVectorXd& first,
                           const Eigen::MatrixXd& accelerations) {
  Eigen::MatrixXd out(t_s.size(), first.size());
  out.row(0) = first;
  for (Eigen::Index t = 1; t < t_s.size(); ++t) {
    out.row(t) = out.row(t - 1) +
                 0.5 * (t_s[t] - t_s[t - 1]) * (accelerations.row(t) + accelerations.row(t - 1));
  }
  return out;
}

PredictedTorque at_samples(const FilteredPrediction& filtered, const TorqueSamples& samples,
                           const TorqueSamples& motion) {
  const auto here = [&](const Eigen::MatrixXd& values) {
    return interpolated(samples.t_s, values, motion.t_s);
  };
  PredictedTorque out{.mean = here(filtered.mean),
                      .frictionless = here(filtered.frictionless),
                      .sigma = here(filtered.sigma)};
  const Eigen::Index n = motion.joints();
  const Eigen::MatrixXd inertia = here(filtered.inertia);
  for (Eigen::Index t = 0; t < motion.size(); ++t) {
    out.inertia.emplace_back(inertia.row(t).reshaped(n, n));
  }
  out.speed = integrated(motion.t_s, here(samples.dq).row(0), here(samples.ddq));
  return out;
}

/// Appends a motion as measured and what the model says of it, to be scaled against each other.
void append(const TorqueSamples& samples, const Eigen::MatrixXd& mean, TorqueSamples& all,
            Eigen::MatrixXd& means) {
  const auto stack = [](Eigen::MatrixXd& top, const Eigen::MatrixXd& below) {
    const Eigen::Index rows = top.rows();
    top.conservativeResize(rows + below.rows(), below.cols());
    top.bottomRows(below.rows()) = below;
  };
  const Eigen::Index rows = all.size();
  all.t_s.conservativeResize(rows + samples.size());
  all.t_s.tail(samples.size()) = samples.t_s;
  all.trajectory.conservativeResize(rows + samples.size());
  all.trajectory.tail(samples.size()) = samples.trajectory;
  stack(all.q, samples.q);
  stack(all.dq, samples.dq);
  stack(all.ddq, samples.ddq);
  stack(all.torque, samples.torque);
  stack(means, mean);
  all.joint_names = samples.joint_names;
  all.torque_unit = samples.torque_unit;
}

/// Joints that move, at most twice as fast as learned (a factor is sought that is negative, or a
/// thousand): at rest friction hides unit and sign of a torque, and
/// beyond what was learned a model that is wrong would pass for a log that is.
std::vector<Eigen::Index> comparable_joints(const SavedTorqueModel& model, const TorqueLog& log,
                                            const TorqueSamples& samples) {
  std::vector<Eigen::Index> out = joints_in_motion(model.rigid, log);
  std::erase_if(out, [&](Eigen::Index j) {
    return samples.dq.col(j).cwiseAbs().maxCoeff() > 2.0 * model.learned.fastest[j];
  });
  return out;
}

void check_scale(const SavedTorqueModel& model, const TorqueLog& log,
                 const std::vector<fs::path>& files, const TorqueSamples& samples,
                 const Eigen::MatrixXd& mean) {
  const std::vector<Eigen::Index> joints = comparable_joints(model, log, samples);
  if (joints.empty()) return;
  TorqueSamples own = with_joints(samples, joints);
  for (const Eigen::Index j : joints)
    own.joint_names.push_back(model.rigid.bodies[static_cast<std::size_t>(j)].joint);
  std::vector<LogFinding> findings = compare_torque_scale(own, mean(Eigen::all, joints)).findings;
  put_into_place(files, findings);
  throw_refusals(findings);
}

}  // namespace

ContactModelChoice choose_contact_model(const ContactCommandOptions& options,
                                        const DynamicModel& robot) {
  if (options.identify) {
    throw bad_request("--identify", "contradicts --model, which brings masses and friction",
                      "leave one of them out");
  }
  ContactModelChoice out;
  const fs::path path = options.model;
  if (torque_model_kind(options.model) || !fs::exists(path)) {
    out.kind = usable_kind(options.model);
    return out;
  }
  out.file = read_torque_model(path);
  out.kind = out.file->model.kind;
  require_model_of(path, out.file->model, robot, options.robot);
  require_own_cutoff(*out.file, options.data.motion.cutoff_hz, path);
  return out;
}

TorqueModelFile learn_contact_model(TorqueModelKind kind, const DynamicModel& robot,
                                    const TorqueLogReport& log,
                                    const std::vector<TrajectorySpan>& contacts,
                                    const TorqueDataOptions& options) {
  const TorqueData data = filtered_data(log, options.motion);
  std::vector<Eigen::Index> free;
  for (Eigen::Index t = 0; t < data.samples.size(); ++t) {
    const bool touched = std::ranges::any_of(contacts, [&](const TrajectorySpan& span) {
      return span.trajectory == data.samples.trajectory_name(data.samples.trajectory[t]) &&
             data.samples.t_s[t] >= span.begin_s && data.samples.t_s[t] <= span.end_s;
    });
    if (!touched && data.samples.is_measured(t)) free.push_back(t);
  }
  TorqueModelOptions models = quick_options();
  models.keep_saved = true;
  const TorqueSamples samples = measured_part(select_rows(data.samples, free));
  check_torque_memory({kind}, samples.size(), samples.joints(), models);
  TorqueModelFile out;
  out.version = program_version();
  out.model = *fit_torque_model(kind, robot, samples, models).saved;
  out.filter = {data.filter, data.cutoff.cutoff_hz};
  out.source = data.source;
  return out;
}

void require_unit_of(const TorqueModelFile& file, const TorqueLogReport& log,
                     const std::vector<fs::path>& files) {
  if (log.log.torque_unit == file.model.torque_unit) return;
  throw bad_input(files.front().string(),
                  fmt::format("its torques are in {}, the model's in {}", log.log.torque_unit,
                              file.model.torque_unit),
                  "state --torque-unit and --torque-factor as for the log it was learned from");
}

PredictedLog predict_log(const TorqueModelFile& file, const TorqueLogReport& log,
                         const std::vector<fs::path>& files, const TorqueDataOptions& options) {
  const MotionOptions filter = motion_as_learned(file, options.motion);
  PredictedLog out;
  TorqueSamples all;
  Eigen::MatrixXd means;
  std::vector<Eigen::Index> measured;  // rows of both
  for (TorqueSamples& motion : unfiltered(log.log, Eigen::VectorXd::Ones(log.log.q.cols()))) {
    const std::optional<TorqueSamples> samples =
        filtered_motion(trajectory_of(log.log, motion.trajectory[0]), filter);
    if (!samples) continue;
    const FilteredPrediction filtered = predict_filtered(file, *samples);
    for (const Eigen::Index row : measured_rows(*samples)) measured.push_back(all.size() + row);
    append(*samples, filtered.mean, all, means);
    all.trajectory.tail(samples->size()).setConstant(motion.trajectory[0]);
    out.torques.push_back(at_samples(filtered, *samples, motion));
    out.motions.push_back(std::move(motion));
  }
  if (out.motions.empty()) {
    throw undetermined(
        files.front().string(),
        fmt::format("no trajectory is long enough for the model's low-pass of {:.3g} Hz",
                    filter.cutoff_hz),
        "record longer");
  }
  check_scale(file.model, log.log, files, select_rows(all, measured), means(measured, Eigen::all));
  out.new_motion = motion_words(file.model.learned, all, file.model.rigid);
  return out;
}

void keep_usable_inertia(const TorqueModelFile& file, PredictedLog& looked_at,
                         std::optional<PredictedLog>& learn) {
  const PredictedLog& source = learn ? *learn : looked_at;
  const std::vector<char> joints = usable_inertia(file.model.rigid, source.motions, source.torques);
  for (PredictedTorque& torque : looked_at.torques)
    torque = with_inertia_of(std::move(torque), joints);
  if (!learn) return;
  for (PredictedTorque& torque : learn->torques)
    torque = with_inertia_of(std::move(torque), joints);
}

std::vector<PredictedFriction> friction_beside(const TorqueModelFile& file,
                                               const PredictedLog& learn) {
  std::vector<PredictedFriction> out =
      predicted_friction(file.model.rigid, learn.motions, learn.torques);
  for (std::size_t j = 0; j < out.size(); ++j) {
    double& fastest = out[j].whole.fastest_known;
    fastest = std::max(fastest, file.model.learned.fastest[static_cast<Eigen::Index>(j)]);
  }
  return out;
}

}  // namespace kinescope
