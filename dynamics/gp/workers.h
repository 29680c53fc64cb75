// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "dynamics/gp/blas.h"

namespace kinescope::gp {

/// Memory for tiles that is kept between uses: after the first round nothing is allocated.
class Scratch {
 public:
  /// A block that is valid until the `Frame` around it ends.
  [[nodiscard]] Eigen::Map<Eigen::MatrixXd> take(Eigen::Index rows, Eigen::Index cols);

  class Frame {
   public:
    explicit Frame(Scratch& scratch) : scratch_(scratch), mark_(scratch.used_) {}
    ~Frame() { scratch_.used_ = mark_; }
    Frame(const Frame&) = delete;
    Frame& operator=(const Frame&) = delete;

   private:
    Scratch& scratch_;
    std::size_t mark_;
  };

 private:
  std::vector<std::vector<double>> buffers_;
  std::size_t used_ = 0;
};

/// Threads that share numbered tasks. A task's result must not depend on who does it or when.
class Workers {
 public:
  /// 0: as many as the machine has.
  explicit Workers(int threads = 0);
  ~Workers();
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  [[nodiscard]] int count() const;
  using Task = std::function<void(Eigen::Index task, Scratch& scratch)>;
  /// Runs tasks 0 .. count-1 and waits. Rethrows the error of the first task (by number) that
  /// failed.
  void run(Eigen::Index tasks, const Task& task);
  /// Scratch of the calling thread.
  [[nodiscard]] Scratch& scratch();

 private:
  struct State;
  std::unique_ptr<State> state_;
  SingleThreadedBlas one_thread_a_call_;
};

}  // namespace kinescope::gp
