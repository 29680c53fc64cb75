// SPDX-License-Identifier: Apache-2.0
//
// Takes   the answer that was found, and the Structure made of it.
// Gives   what the recording leaves in doubt about it, with the remedy, put into the Structure.
#pragma once

#include "kinematics/structure/answer.h"

namespace kinescope::structure_search {

/// The markers move, the channels move, but not together, or few of them: the clocks are further
/// apart than was scanned, or run at different rates. `fitted` to `full`, `readings` at its
/// instants.
void doubt_clocks(const GrownTree& fitted, const Readings& readings, const Series& full,
                  const JointLog& log, const StructureOptions& options, Structure& out);

/// Errors that are no noise had to be allowed for.
void doubt_allowance(const Answer& answer, Structure& out);

/// One motor may move several joints; a marker seen wrongly looks like a second joint, too. In
/// place of what was said of it before.
void doubt_shared_channels(const JointLog& log, Structure& out);

/// Columns that repeat others.
void doubt_copies(const JointLog& log, Structure& out);

/// A joint without a channel beside channels without a joint: they may belong together in a way
/// that the model lacks (values that wrap, a channel with a delay of its own).
void doubt_unpaired(const Readings& readings, const OwnLog& own, Structure& out);

/// The likelihoods compare answers with each other. How far the data are from the best of them is
/// judged with the sightings' own noise (`plain`); a wrong answer is worth no more than what it
/// explains.
void judge_fit(const Answer& answer, const Series& plain, const JointLog& log, const OwnLog& own,
               const StructureOptions& options, Structure& out);

}  // namespace kinescope::structure_search
