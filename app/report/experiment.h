// SPDX-License-Identifier: Apache-2.0
//
// Takes   what an experiment found: words, tables, drawings.
// Gives   the page, the document (schema: app/io/schema/experiment.schema.json), the tables as CSV.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "app/report/run_summary.h"

namespace kinescope {

/// Rows of words and numbers; a number that is not known is NaN and stays empty.
struct ExperimentTable {
  std::string id;  ///< its file is ID.csv
  std::string caption;
  std::vector<std::string> labels;  ///< names of the columns of words, first
  std::vector<std::string> values;  ///< names of the columns of numbers, with unit
  struct Row {
    std::vector<std::string> labels;
    std::vector<double> values;
  };
  std::vector<Row> rows;
};

struct ExperimentSection {
  std::string id;
  std::string title;
  std::vector<std::string> words;   ///< a paragraph each
  std::vector<std::string> tables;  ///< their ids
  struct Figure {
    std::string drawing;  ///< of report::Plot
    std::string caption;
  };
  std::vector<Figure> figures;
};

struct ExperimentSummary {
  std::string name;
  std::string title;
  std::string version;
  std::string command;
  std::vector<InputFile> inputs;  ///< of a user's own log
  std::vector<std::pair<std::string, std::string>> settings;
  std::vector<std::string> findings;  ///< a sentence each: the page's verdict
  std::vector<ExperimentSection> sections;
  std::vector<ExperimentTable> tables;
};

[[nodiscard]] nlohmann::json experiment_json(const ExperimentSummary& summary);
[[nodiscard]] std::string experiment_html(const ExperimentSummary& summary);
/// Nine significant digits; words in quotes where they need them.
[[nodiscard]] std::string experiment_csv(const ExperimentTable& table);

}  // namespace kinescope
