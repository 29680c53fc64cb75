// SPDX-License-Identifier: Apache-2.0
#include "app/torque/torque_split.h"

#include "app/report/motion_words.h"
#include "app/torque/torque_inputs.h"
#include "dynamics/data/splits.h"
#include "kinematics/recorded/recorded_log.h"

namespace kinescope {
namespace {

// Share of the samples that is held out where no log is named for it.
constexpr double kHeldOut = 0.3;

void take(const Fold& fold, TorqueSummary& summary) {
  summary.train = select_rows(summary.data.samples, fold.train);
  summary.test = select_rows(summary.data.samples, fold.test);
}

void split_log(bool at_random, std::uint64_t seed, TorqueSummary& summary) {
  summary.split_at_random = at_random;
  if (at_random) {
    take(split_at_random(summary.data.samples, kHeldOut, seed), summary);
    summary.split = "samples of the log by lot";
    return;
  }
  take(split_last(summary.data.samples, kHeldOut), summary);
  const bool whole = summary.train.trajectory.size() > 0 &&
                     (summary.test.trajectory.array() != summary.train.trajectory[0]).all();
  summary.split = whole ? "unseen trajectories of the log" : "the log's last part, after a gap";
}

}  // namespace

void split_samples(const DynamicsOptions& options, const DynamicModel& model,
                   TorqueSummary& summary) {
  if (options.test_logs.empty()) {
    split_log(options.split_at_random, options.models_options.seed, summary);
  } else {
    TorqueDataOptions data = options.data;
    data.motion.cutoff_hz = summary.data.cutoff.cutoff_hz;  // alike, or the scores are not
    summary.train = measured_part(summary.data.samples);
    const TorqueSamples test = read_torque_data(recorded::read_channel_tables(options.test_logs),
                                                wanted_joints(model.tree), data)
                                   .samples;
    summary.test = test.torque_missing.size() > 0 ? split_at_gaps(measured_part(test)) : test;
    summary.split = "the unseen log " + file_list(options.test_logs);
  }
  const RigidModel rigid = make_rigid_model(model);
  if (std::ssize(rigid.bodies) != summary.test.joints()) return;  // refused by the fit
  summary.new_motion = motion_words(span_of(summary.train), summary.test, rigid);
}

}  // namespace kinescope
