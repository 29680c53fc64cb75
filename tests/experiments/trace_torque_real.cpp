#include <fmt/format.h>
#include <chrono>
#include "dynamics/data/torque_data.h"
#include "dynamics/effects/trace_torque.h"
#include "calib/trace/trace.h"
#include "kinematics/urdf/dynamic_urdf.h"
#include "tests/truth/shared_data.h"
using namespace kinescope;
int main(int argc, char** argv) {
  for (int a = 1; a < argc; ++a) {
    const auto folder = shared_data(std::string("synthetic_dynamics/") + argv[a]);
    DynamicModel model = read_dynamic_urdf(*folder / "nominal.urdf");
    model.gravity_m_s2 = {0, 0, -9.81};
    auto t0 = std::chrono::steady_clock::now();
    const auto lap = [&](const char* what) {
      auto t1 = std::chrono::steady_clock::now();
      fmt::print("  [{} {:.2f} s]\n", what, std::chrono::duration<double>(t1 - t0).count());
      std::fflush(stdout);
      t0 = t1;
    };
    TorqueData data = read_torque_data({*folder / "log.csv.gz"}, wanted_joints(model.tree));
    TorqueDataOptions read;
    read.motion.cutoff_hz = tracing_cutoff_hz(data.cutoff);
    fmt::print("cut-off {:.2f}, motion ends {:.2f}\n", data.cutoff.cutoff_hz, data.cutoff.motion_end_hz.maxCoeff());
    data = read_torque_data({*folder / "log.csv.gz"}, wanted_joints(model.tree), read);
    fmt::print("{}: {} samples {:.1f} Hz, cutoff {:.2f}\n", argv[a], data.samples.size(), data.rate_hz, data.cutoff.cutoff_hz);
    lap("read");
    TorqueTraceOptions options;
    options.model.filter = {data.filter, data.cutoff.cutoff_hz};
    const TorqueTrace traced = trace_torque(model, data.samples, options);
    lap("trace");
    fmt::print("base {}: {}\n", to_string(traced.base.kind), traced.base.reason);
    for (double s : traced.base.sigma) fmt::print(" {:.4g}", s);
    fmt::print("\n");
    const Trace& trace = traced.trace;
    {
      const TorqueData test = read_torque_data({*folder / "log_test.csv.gz"}, wanted_joints(model.tree));
      const TorqueFilter f{test.filter, test.cutoff.cutoff_hz};
      const Eigen::MatrixXd p = predict_torque(traced.corrected, test.samples, f);
      for (Eigen::Index j = 0; j < p.cols(); ++j) fmt::print(" test nMSE {:.4g}", 100 * (test.samples.torque.col(j) - p.col(j)).squaredNorm() / (test.samples.torque.col(j).array() - test.samples.torque.col(j).mean()).square().sum());
      fmt::print("\n");
    }
    fmt::print("{}: {}\nheld out {:.4g} -> {:.4g}  stretches {}\n", to_string(trace.verdict), trace.reason, trace.held_out_before.value, trace.held_out_after.value, trace.stretches);
    for (const auto& e : trace.accepted) {
      fmt::print("  {:<18} {:<12} {:9.4g} [{:.4g}, {:.4g}] {} {} {:.4g}  explained {:.3g} p {:.2g}\n", e.id.effect, e.id.place, e.size, e.interval.low, e.interval.high, e.unit, e.scan_name, e.scan, e.explained, e.p_value);
    }
    for (const auto& s : trace.steps) fmt::print("   step {} {} {:.4g}\n", s.round, s.words, s.held_out.value);
    for (const auto& am : trace.ambiguities) { fmt::print("  ambiguous:"); for (auto& e : am.effects) fmt::print(" {}@{}", e.effect, e.place); fmt::print("\n"); }
  }
}
