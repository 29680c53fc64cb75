// SPDX-License-Identifier: Apache-2.0
#include "dynamics/control/kinescope_torque.h"

#include <algorithm>
#include <exception>
#include <new>
#include <string>
#include <string_view>
#include <vector>

#include "dynamics/control/torque_evaluator.h"

using kinescope::TorqueBand;
using kinescope::TorqueEvaluator;
using kinescope::TorqueStatus;

static_assert(static_cast<int>(TorqueStatus::kDone) == KINESCOPE_TORQUE_DONE);
static_assert(static_cast<int>(TorqueStatus::kBadArgument) == KINESCOPE_TORQUE_BAD_ARGUMENT);
static_assert(static_cast<int>(TorqueStatus::kNotFinite) == KINESCOPE_TORQUE_NOT_FINITE);

struct kinescope_torque_model {
  explicit kinescope_torque_model(const char* path)
      : evaluator(std::filesystem::path(path)), unit(evaluator.torque_unit()) {
    for (std::size_t j = 0; j < evaluator.joints(); ++j)
      names.emplace_back(evaluator.joint_name(j));
  }
  [[nodiscard]] std::span<const double> in(const double* values) const noexcept {
    return {values, evaluator.joints()};
  }
  [[nodiscard]] std::span<double> out(double* values) const noexcept {
    return {values, evaluator.joints()};
  }

  TorqueEvaluator evaluator;
  std::vector<std::string> names;  // ended by 0
  std::string unit;
};

namespace {

void say(std::string_view what, char* error, std::size_t size) noexcept {
  if (error == nullptr || size == 0) return;
  const std::size_t length = std::min(what.size(), size - 1);
  std::ranges::copy(what.substr(0, length), error);
  error[length] = '\0';
}

}  // namespace

kinescope_torque_model* kinescope_torque_load(const char* path, char* error, size_t error_size) {
  if (path == nullptr) {
    say("no path", error, error_size);
    return nullptr;
  }
  try {
    return new kinescope_torque_model(path);
  } catch (const std::exception& exception) {
    say(exception.what(), error, error_size);
  } catch (...) {
    say("unknown exception", error, error_size);
  }
  return nullptr;
}

void kinescope_torque_free(kinescope_torque_model* model) { delete model; }

size_t kinescope_torque_joints(const kinescope_torque_model* model) {
  return model == nullptr ? 0 : model->names.size();
}

const char* kinescope_torque_joint_name(const kinescope_torque_model* model, size_t joint) {
  return joint < kinescope_torque_joints(model) ? model->names[joint].c_str() : nullptr;
}

const char* kinescope_torque_unit(const kinescope_torque_model* model) {
  return model == nullptr ? nullptr : model->unit.c_str();
}

int kinescope_torque_traced(const kinescope_torque_model* model) {
  return model != nullptr && model->evaluator.traced() ? 1 : 0;
}

int kinescope_torque_mean(kinescope_torque_model* model, const double* q, const double* dq,
                          const double* ddq, double* torque) {
  if (!model || !q || !dq || !ddq || !torque) return KINESCOPE_TORQUE_BAD_ARGUMENT;
  return static_cast<int>(
      model->evaluator.mean(model->in(q), model->in(dq), model->in(ddq), model->out(torque)));
}

int kinescope_torque_mean_and_band(kinescope_torque_model* model, const double* q, const double* dq,
                                   const double* ddq, double* torque, double* half_width,
                                   int percent) {
  if (!model || !q || !dq || !ddq || !torque || !half_width || (percent != 90 && percent != 95)) {
    return KINESCOPE_TORQUE_BAD_ARGUMENT;
  }
  return static_cast<int>(model->evaluator.mean_and_band(
      model->in(q), model->in(dq), model->in(ddq), model->out(torque), model->out(half_width),
      percent == 90 ? TorqueBand::k90 : TorqueBand::k95));
}
