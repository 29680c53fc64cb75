// SPDX-License-Identifier: Apache-2.0
//
// Values of a JSON document, and where in it is wrong what cannot be read. For the readers of
// torque models here and in app/io; not installed.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "kinematics/core/error.h"

namespace kinescope {

/// Every reader throws bad_input that names file and key for a value of another kind, a number that
/// is not finite, or another count than the one that is asked for.
class JsonReader {
 public:
  using json = nlohmann::json;

  explicit JsonReader(const std::filesystem::path& path,
                      std::string remedy = "give a file of kinescope dynamics --save-model")
      : path_(path.string()), remedy_(std::move(remedy)) {}

  [[nodiscard]] Error wrong(std::string_view what) const;
  [[nodiscard]] const json& at(const json& object, const char* key) const;
  [[nodiscard]] const json& array(const json& object, const char* key) const;
  [[nodiscard]] double number(const json& value, const char* key) const;
  [[nodiscard]] double number_at(const json& object, const char* key) const;
  [[nodiscard]] bool flag(const json& object, const char* key) const;
  [[nodiscard]] std::string word(const json& object, const char* key) const;
  /// Whole, from -1 (no parent).
  [[nodiscard]] int integer(const json& value, const char* key) const;
  [[nodiscard]] std::vector<int> integers(const json& object, const char* key) const;
  [[nodiscard]] Eigen::VectorXi integer_vector(const json& object, const char* key) const;
  [[nodiscard]] Eigen::VectorXd vector_of(const json& values, const char* key) const;
  [[nodiscard]] Eigen::VectorXd vector(const json& object, const char* key) const;
  [[nodiscard]] Eigen::VectorXd vector(const json& object, const char* key,
                                       Eigen::Index size) const;
  /// A list of rows.
  [[nodiscard]] Eigen::MatrixXd matrix(const json& object, const char* key,
                                       Eigen::Index columns) const;
  /// Upper triangle, column after column; at most so many columns.
  [[nodiscard]] Eigen::MatrixXd triangle(const json& object, const char* key,
                                         Eigen::Index most) const;

 private:
  std::string path_;
  std::string remedy_;
};

}  // namespace kinescope
