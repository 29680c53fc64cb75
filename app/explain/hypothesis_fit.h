// SPDX-License-Identifier: Apache-2.0
//
// Takes   what was seen of a recording, and one hypothesis about it: a structure, effects to begin
//         with, a camera or markers other than the declared ones, a nominal robot.
// Gives   the explanation that the hypothesis comes to: fitted, and traced where asked.
// Not here: which hypotheses (explainer.cpp), which of them is the best (compare_explanations.h).
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "app/explain/doubted_sight.h"
#include "app/explain/explain.h"

namespace kinescope {

class HypothesisFit {
 public:
  /// What `evidence` refers to must outlive it.
  HypothesisFit(Evidence evidence, ExplainOptions options)
      : evidence_(std::move(evidence)), options_(std::move(options)) {}

  /// The structure that was declared and read, fitted alone.
  [[nodiscard]] Explanation plainly_explained() const;
  /// The robot and the effects of an explanation of other evidence; nothing where that found none.
  [[nodiscard]] std::optional<Explanation> carried_over(const Explanation& of) const;
  /// Of what was declared and read, without a nominal robot.
  [[nodiscard]] Structure believed_structure() const;
  /// Of a nominal robot: mended, fitted, traced.
  [[nodiscard]] Explanation of_nominal(std::vector<std::string>& warnings) const;
  /// A fit of the structure, and what it lacks.
  [[nodiscard]] Explanation of_structure(Structure structure, const TraceStart& begin) const;
  /// A fit of the structure alone.
  [[nodiscard]] Explanation plainly_fitted(Structure structure) const;
  /// The robot that shows with another sight, beside that; nothing where none does.
  [[nodiscard]] std::optional<Explanation> fitted_with(const Sight& sight) const;
  /// What a plain fit lacks, found and added.
  [[nodiscard]] Explanation traced(Explanation plain, const TraceStart& begin) const;
  /// Of a part or a change of the evidence, which may lack what was declared.
  [[nodiscard]] std::optional<Structure> proposed_structure(
      const PoseTracks& tracks, std::optional<double> allowance = {}) const;
  /// The tracks without the effects that were found.
  [[nodiscard]] PoseTracks undone(const Calibration& calibration) const;

 private:
  [[nodiscard]] const Recording& recording() const { return evidence_.recording; }
  /// What every explanation holds.
  [[nodiscard]] Explanation begun() const;
  [[nodiscard]] Calibration calibrated(const CalibrationStart& start, FreeGeometry free) const;
  [[nodiscard]] TracedCalibration closed_loop(const CalibrationStart& start, FreeGeometry free,
                                              const Calibration& plain,
                                              const TraceStart& begin) const;
  [[nodiscard]] Structure structure_of(const PoseTracks& tracks,
                                       std::optional<double> allowance = {}) const;
  [[nodiscard]] Structure whole_of(Structure robot, const PoseTracks& tracks) const;
  void lap(std::string_view stage) const;
  void close_loop(Explanation& out, const TraceStart& begin) const;

  const Evidence evidence_;
  const ExplainOptions options_;
};

}  // namespace kinescope
