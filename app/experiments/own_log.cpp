// SPDX-License-Identifier: Apache-2.0
#include "app/experiments/own_log.h"

#include <fmt/format.h>

#include "dynamics/data/splits.h"

namespace kinescope {

using experiments::ComparisonCase;

std::vector<experiments::Learner> chosen_learners(const ExperimentChoice& choice) {
  return choice.learners.value_or(experiments::usual_learners());
}

experiments::LearnOptions learn_options(const ExperimentChoice& choice) {
  experiments::LearnOptions out;
  out.search.starts = choice.starts.value_or(out.search.starts);
  out.search.samples = choice.search_samples.value_or(out.search.samples);
  out.search.seed = choice.seed;
  out.inducing = choice.inducing.value_or(out.inducing);
  out.threads = choice.threads;
  return out;
}

std::vector<std::pair<std::string, std::string>> learn_settings(
    const ExperimentChoice& choice, const experiments::LearnOptions& learn) {
  return {{"Seed", fmt::format("{}", choice.seed)},
          {"Starts of every search of hyperparameters", fmt::format("{}", learn.search.starts)},
          {"Samples that the search sees", fmt::format("at most {}", learn.search.samples)}};
}

std::vector<ComparisonCase> cases_of_log(const ExperimentLog& log, int runs, int samples) {
  std::vector<ComparisonCase> out;
  for (const Fold& fold : split_folds(log.samples, {.folds = runs}).folds) {
    ComparisonCase one{log.robot, select_rows(log.samples, fold.train),
                       select_rows(log.samples, fold.test)};
    if (samples > 0 && one.train.size() > samples) {
      one.train = select_rows(one.train, evenly_chosen(one.train.size(), samples));
    }
    out.push_back(std::move(one));
  }
  return out;
}

}  // namespace kinescope
