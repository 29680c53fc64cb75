// SPDX-License-Identifier: Apache-2.0
//
// Takes   a file of `kinescope dynamics --save-model`; positions, rates and accelerations.
// Gives   each joint's torque for one sample, and on request the half-width of its band.
// Units   q in rad or m, rates and accelerations per s and s^2; torques in torque_unit().
// Method  models/torque_predictor.h; the same bits as `kinescope predict`.
// Not here: effects with a memory (dynamics/effects), feedback, limits: the controller's.
//
// The library kinescope_torque, for users' controllers: this header shows the standard library
// only, and kinescope_torque.h is the same in C. It reads files by models/saved_model_file.h; the
// reader in app/io would link every room of effects and files into a controller.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <span>
#include <string_view>

namespace kinescope {

struct SavedTorqueModel;

enum class TorqueStatus : int {
  kDone = 0,
  kBadArgument = 1,  ///< a span that has not one entry a joint
  kNotFinite = 2     ///< NaN or infinity in the sample, or a torque that overflows
};

/// Parts of new measurements that lie within mean +- half-width.
enum class TorqueBand { k90, k95 };

/// One a thread: a call works in the evaluator's own memory. It allocates nothing, throws nothing,
/// takes no lock, and its time depends on the model alone. What is not kDone leaves the outputs as
/// they were. A joint's three inputs stand at the joint's place in joint_name().
class TorqueEvaluator {
 public:
  /// Throws kinescope::Error, one line, for what is no such file or does not fit itself.
  explicit TorqueEvaluator(const std::filesystem::path& file);
  /// Throws kinescope::Error for parts that do not fit each other.
  explicit TorqueEvaluator(const SavedTorqueModel& model);
  ~TorqueEvaluator();
  TorqueEvaluator(TorqueEvaluator&&) noexcept;
  TorqueEvaluator& operator=(TorqueEvaluator&&) noexcept;

  [[nodiscard]] std::size_t joints() const noexcept;
  /// Empty beyond the last.
  [[nodiscard]] std::string_view joint_name(std::size_t joint) const noexcept;
  /// "Nm" or "A"; of sliding joints N for "Nm".
  [[nodiscard]] std::string_view torque_unit() const noexcept;
  /// "parametric", "rbf", "gip" or "semi_parametric".
  [[nodiscard]] std::string_view kind() const noexcept;
  /// The file holds effects that tracing found, too. Some need the motion before the sample:
  /// `kinescope predict` has them, the torques here are those of the model without them.
  [[nodiscard]] bool traced() const noexcept;

  /// Spans of one entry a joint; the output may be one of the inputs.
  [[nodiscard]] TorqueStatus mean(std::span<const double> q, std::span<const double> dq,
                                  std::span<const double> ddq, std::span<double> torque) noexcept;
  /// The same with the half-width: infinite where the model knows nothing.
  [[nodiscard]] TorqueStatus mean_and_band(std::span<const double> q, std::span<const double> dq,
                                           std::span<const double> ddq, std::span<double> torque,
                                           std::span<double> half_width,
                                           TorqueBand band = TorqueBand::k90) noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace kinescope
