// SPDX-License-Identifier: Apache-2.0
//
// `kinescope control`: a simulated robot along a trajectory, by controllers that know more or less
// of it.
#include <fmt/format.h>

#include "app/commands/commands.h"
#include "app/commands/control_bench.h"
#include "app/commands/simulated_robot.h"
#include "app/io/json_text.h"
#include "app/io/torque_model_file.h"
#include "app/torque/model_of_robot.h"
#include "app/torque/model_torque.h"
#include "dynamics/experiments/logged_runs.h"
#include "kinematics/core/file.h"

namespace kinescope {
namespace {

namespace fs = std::filesystem;

constexpr const char* kModelOfRound = "torque.json";

/// What --model or a round holds.
struct Learned {
  std::string kind;
  std::shared_ptr<const LearnedTorque> torque;
};

Learned learned_of_file(const fs::path& file, const ControlBench& bench) {
  const TorqueModelFile saved = read_torque_model(file);
  require_model_of(file, saved.model, bench.nominal().model, bench.nominal_file());
  LearnedTorque out{.model = saved.model};
  if (saved.traced) out.traced = saved.traced->corrected;
  return {std::string(to_string(saved.model.kind)) + (saved.traced ? ", traced" : ""),
          std::make_shared<const LearnedTorque>(std::move(out))};
}

/// The masses and effects that `dynamics` traced.
Learned learned_of_trace(const fs::path& folder, const ControlOptions& options,
                         const ControlBench& bench) {
  const fs::path urdf = folder / "robot_traced.urdf";
  const TorqueRobot robot = read_torque_robot(urdf, options.gravity_m_s2);
  if (robot.joints != bench.nominal().joints) {
    throw bad_input(urdf.string(), "is another robot: its joints have other names",
                    "give the trace of a log of this robot");
  }
  LearnedTorque out;
  out.traced =
      simulated_robot(urdf, robot.model, folder / "trace.json", bench.reference(), bench.console());
  return {"traced", std::make_shared<const LearnedTorque>(std::move(out))};
}

Learned learned_of(const fs::path& file, const ControlOptions& options, const ControlBench& bench) {
  const std::string name = file.filename().string();
  if (name == "dynamics.json" || name == "trace.json") {
    return learned_of_trace(file.parent_path(), options, bench);
  }
  return learned_of_file(file, bench);
}

std::string round_name(int round) { return fmt::format("round{}", round); }

Writer writer_of(const ControlOptions& options) {
  Writer out{.command = "control", .products = {}, .inputs = {}, .force = options.force};
  out.products = {"control.json", "control.html",      "before.csv",         "nominal.csv",
                  "learned.csv",  "loaded_before.csv", "loaded_unknown.csv", "loaded_known.csv"};
  for (int round = 1; round <= options.rounds; ++round) {
    out.products.push_back(round_name(round) + ".csv");
    out.products.push_back(round_name(round) + "_training.csv");
  }
  out.inputs = {options.robot, options.trajectory};
  for (const auto& file : {options.effects, options.nominal, options.model, options.training}) {
    if (file) out.inputs.push_back(*file);
  }
  return out;
}

/// One a round, for what it learns.
std::vector<OutputFolder> round_folders(const ControlOptions& options, const Writer& writer) {
  std::vector<OutputFolder> out;
  for (int round = 1; round <= options.rounds; ++round) {
    Writer own = writer;
    own.products = dynamics_products("trace.json");
    own.products.emplace_back(kModelOfRound);
    out.emplace_back(options.output / round_name(round), own);
  }
  return out;
}

Contender baseline() { return {"PD, nominal gravity", "before", ControlLaw::kPdGravity}; }

std::string law_words(ControlLaw law) {
  switch (law) {
    case ControlLaw::kPd:
      return "PD";
    case ControlLaw::kPdGravity:
      return "PD, gravity";
    case ControlLaw::kFeedForward:
      return "feed-forward";
    default:
      return "computed torque";
  }
}

std::string of_nominal(ControlLaw law) {
  return law_words(law) + (law == ControlLaw::kPd ? "" : ", nominal masses");
}

/// Controllers one after another, into the summary.
class Session {
 public:
  Session(const ControlOptions& options, const ControlBench& bench, const OutputFolder& folder,
          const std::vector<OutputFolder>& rounds, const Progress& progress,
          ControlSummary& summary)
      : options_(options),
        bench_(bench),
        folder_(folder),
        rounds_(rounds),
        progress_(progress),
        out_(summary) {}

  void run() {
    Contender before = baseline();
    if (options_.rounds > 0) before.round = 0;
    judge(before);
    if (options_.servo.law != ControlLaw::kPdGravity) {
      judge({of_nominal(options_.servo.law), "nominal", options_.servo.law});
    }
    if (options_.model) {
      best_ = learned_of(*options_.model, options_, bench_);
      out_.model = best_->kind;
      judge(with(*best_, law_words(options_.servo.law) + ", " + best_->kind, "learned"));
    }
    close_the_loop();
    if (options_.payload_kg) carry();
  }

 private:
  void judge(const Contender& contender) {
    report_progress(progress_, contender.name, 0, 0);
    out_.runs.push_back(bench_.judge(contender, folder_));
  }
  [[nodiscard]] Contender with(const Learned& learned, std::string name, std::string file) const {
    return {std::move(name), std::move(file), options_.servo.law, learned.kind, learned.torque};
  }

  /// Run, log, learn, compensate, run again.
  void close_the_loop() {
    Contender controller = baseline();
    std::vector<fs::path> logs;
    for (int round = 1; round <= options_.rounds; ++round) {
      const std::string name = round_name(round);
      controller.file = name + "_training";
      report_progress(progress_, controller.file, 0, 0);
      const ServoLog log = bench_.follow(controller, bench_.training(round));
      folder_.write(controller.file + ".csv", torque_log_csv(log.samples, bench_.robot().joints));
      logs.push_back(folder_.file(controller.file + ".csv"));
      best_ = learn(logs, rounds_[static_cast<std::size_t>(round - 1)]);
      controller = with(
          *best_,
          fmt::format("round {}: {}, {}", round, law_words(options_.servo.law), best_->kind), name);
      controller.round = round;
      judge(controller);
    }
  }

  [[nodiscard]] Learned learn(const std::vector<fs::path>& logs, const OutputFolder& own) const {
    DynamicsOptions dynamics;
    dynamics.logs = logs;
    dynamics.robot = bench_.nominal_file();
    dynamics.save_model = own.file(kModelOfRound);
    dynamics.output = dynamics.save_model.parent_path();
    dynamics.models = {options_.learn};
    dynamics.models_options = quick_options();
    dynamics.robust = false;
    dynamics.trace = options_.learn == to_string(TorqueModelKind::kParametric);
    dynamics.gravity_m_s2 = options_.gravity_m_s2;
    dynamics.owner = "control";
    dynamics.force = options_.force;
    dynamics.command_line = options_.command_line;
    own.remove(kModelOfRound);
    (void)model_torque(dynamics, progress_);
    own.write(kModelOfRound, read_text_file(dynamics.save_model));
    return learned_of_file(dynamics.save_model, bench_);
  }

  /// The same with the load: unknown, then identified from the logs with and without it.
  void carry() {
    Contender before = baseline();
    before.name += ", loaded";
    before.file = "loaded_before";
    before.loaded = true;
    judge(before);
    Contender learned = best_ ? with(*best_, "", "") : Contender{"", "", options_.servo.law};
    const ControlLaw law = options_.servo.law;
    const std::string name = best_ ? law_words(law) + ", " + best_->kind : of_nominal(law);
    learned.loaded = true;
    learned.name = name + ", load unknown";
    learned.file = "loaded_unknown";
    judge(learned);
    report_progress(progress_, "payload", 0, 0);
    Contender alone = baseline();
    const TorqueSamples path = bench_.training(0);
    const DynamicModel& robot = bench_.nominal().model;
    const ServoLog unloaded = bench_.follow(alone, path);
    out_.payload = estimate_payload(
        robot, experiments::motion_of_run(bench_.follow(before, path), robot).samples,
        experiments::motion_of_run(unloaded, robot).samples);
    learned.known_load = InertialParameters::from_vector(out_.payload->parameters);
    learned.name = name + ", load identified";
    learned.file = "loaded_known";
    judge(learned);
  }

  const ControlOptions& options_;
  const ControlBench& bench_;
  const OutputFolder& folder_;
  const std::vector<OutputFolder>& rounds_;
  const Progress& progress_;
  ControlSummary& out_;
  std::optional<Learned> best_;  ///< the last one learned
};

ControlSummary summary_of(const ControlOptions& options, const ControlBench& bench,
                          const Writer& writer) {
  ControlSummary out;
  out.robot = bench.robot().model.tree.name;
  out.version = program_version();
  out.command = options.command_line;
  out.inputs = hashed_inputs({writer.inputs});
  out.joints = bench.robot().joints;
  out.types = bench.robot().types;
  out.servo = bench.servo();
  out.seed = options.seed;
  out.samples = bench.reference().size();
  out.t_s = bench.shown_times();
  out.payload_kg = options.payload_kg;
  if (options.rounds > 0) {
    out.training = options.training ? options.training->filename().string()
                                    : "sinusoids within the trajectory's range";
  }
  return out;
}

void check_request(const ControlOptions& options) {
  if (options.payload_kg && !(*options.payload_kg > 0.0)) {
    throw bad_request("--payload", fmt::format("a mass of {} kg", *options.payload_kg),
                      "give one above 0");
  }
  if (options.servo.law == ControlLaw::kPd && (options.model || options.rounds > 0)) {
    throw bad_request("--law", "pd has no place for what was learned",
                      "name pd_gravity, feed_forward or computed_torque");
  }
  if (options.training && options.rounds == 0) {
    throw bad_request("--training", "nothing is learned without rounds", "add --rounds 1");
  }
}

}  // namespace

ExitCode control_command(const ControlOptions& options, const Console& console) {
  check_request(options);
  const Writer writer = writer_of(options);
  const ControlBench bench(options, console);
  if (options.model) (void)learned_of(*options.model, options, bench);  // before any work
  const OutputFolder folder(options.output, writer);
  const std::vector<OutputFolder> rounds = round_folders(options, writer);
  ControlSummary summary = summary_of(options, bench, writer);
  Session(options, bench, folder, rounds, console.progress, summary).run();
  report_progress(console.progress, "", 0, 0);
  const nlohmann::json document = control_json(summary);
  folder.write({{"control.json", json_text(document)}, {"control.html", control_html(summary)}});
  if (console.json) {
    console.print(document);
    return ExitCode::kDone;
  }
  for (const std::string& finding : control_findings(summary)) fmt::print("{}\n", finding);
  fmt::print("numbers {}\npage    {}\n", folder.file("control.json").string(),
             folder.file("control.html").string());
  return ExitCode::kDone;
}

}  // namespace kinescope
