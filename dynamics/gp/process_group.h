// SPDX-License-Identifier: Apache-2.0
//
// Takes   nothing: mpirun said how many processes there are.
// Gives   ProcessGroup, while which fit() shares a dense kernel matrix among these processes.
// Method  every process runs the same program on the same data. Where a kernel matrix is kept, each
//         holds its blocks of it (block-cyclic), and ScaLAPACK (Blackford and others 1997) factors
//         it: pdpotrf, pdpotrs. All get the same answers, one process's to rounding.
// Not here: leave_out() and the search of hyperparameters, which each process does by itself.
#pragma once

namespace kinescope::gp {

/// Joins the processes that mpirun started; a process by itself otherwise. One at a time, in the
/// thread that calls fit(): while there are several processes, all of them must make the same calls
/// of fit() and predict() in the same order. Throws bad_request where mpirun started several of a
/// program that was built without KINESCOPE_SCALAPACK.
class ProcessGroup {
 public:
  ProcessGroup();
  /// Where an exception ends it, it does not wait for the others: mpirun ends them.
  ~ProcessGroup();
  ProcessGroup(const ProcessGroup&) = delete;
  ProcessGroup& operator=(const ProcessGroup&) = delete;
};

/// Of the present ProcessGroup; 1 where there is none.
[[nodiscard]] int process_count();
/// From 0, which is the one that prints and writes.
[[nodiscard]] int process_rank();
/// What the processes of this machine hold together of a shared matrix, as a share of it.
[[nodiscard]] double machine_share();

}  // namespace kinescope::gp
