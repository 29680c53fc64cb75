// SPDX-License-Identifier: Apache-2.0
//
// In place of scalapack.cpp where the build is without it.
#include <cstdlib>
#include <string>

#include "dynamics/gp/posterior.h"
#include "dynamics/gp/process_group.h"
#include "kinematics/core/error.h"

namespace kinescope::gp {

// Open MPI says so to whom it starts.
ProcessGroup::ProcessGroup() {
  const char* count = std::getenv("OMPI_COMM_WORLD_SIZE");
  if (count != nullptr && std::string(count) != "1") {
    throw bad_request("mpirun", std::string(count) + " processes, and a build for one",
                      "configure with -DKINESCOPE_SCALAPACK=ON, or leave mpirun out");
  }
}

ProcessGroup::~ProcessGroup() = default;

int process_count() { return 1; }
int process_rank() { return 0; }
double machine_share() { return 1.0; }

Fit fit_distributed(Workers&, const Kernel&, const Eigen::VectorXd&, Problem, const FitOptions&) {
  KINESCOPE_CHECK(false, "there is one process");
  return {};
}

}  // namespace kinescope::gp
