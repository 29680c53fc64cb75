// SPDX-License-Identifier: Apache-2.0
#include "dynamics/models/json_reader.h"

#include <cmath>
#include <limits>

#include <fmt/format.h>

namespace kinescope {

using Eigen::Index;
using nlohmann::json;

Error JsonReader::wrong(std::string_view what) const { return bad_input(path_, what, remedy_); }

const json& JsonReader::at(const json& object, const char* key) const {
  if (!object.is_object() || !object.contains(key))
    throw wrong(fmt::format("'{}' is missing", key));
  return object.at(key);
}

const json& JsonReader::array(const json& object, const char* key) const {
  const json& out = at(object, key);
  if (!out.is_array()) throw wrong(fmt::format("'{}' is no list", key));
  return out;
}

double JsonReader::number(const json& value, const char* key) const {
  if (!value.is_number() || !std::isfinite(value.get<double>()))
    throw wrong(fmt::format("'{}' holds what is no number", key));
  return value.get<double>();
}

double JsonReader::number_at(const json& object, const char* key) const {
  return number(at(object, key), key);
}

bool JsonReader::flag(const json& object, const char* key) const {
  const json& out = at(object, key);
  if (!out.is_boolean()) throw wrong(fmt::format("'{}' is neither true nor false", key));
  return out.get<bool>();
}

std::string JsonReader::word(const json& object, const char* key) const {
  const json& out = at(object, key);
  if (!out.is_string()) throw wrong(fmt::format("'{}' is no text", key));
  return out.get<std::string>();
}

int JsonReader::integer(const json& value, const char* key) const {
  const bool fits = value.is_number_integer() && value.get<double>() >= -1.0 &&
                    value.get<double>() <= std::numeric_limits<int>::max();
  if (!fits) throw wrong(fmt::format("'{}' holds what is no number of anything", key));
  return value.get<int>();
}

std::vector<int> JsonReader::integers(const json& object, const char* key) const {
  std::vector<int> out;
  for (const json& value : array(object, key)) out.push_back(integer(value, key));
  return out;
}

Eigen::VectorXi JsonReader::integer_vector(const json& object, const char* key) const {
  const std::vector<int> values = integers(object, key);
  return Eigen::Map<const Eigen::VectorXi>(values.data(), std::ssize(values));
}

Eigen::VectorXd JsonReader::vector_of(const json& values, const char* key) const {
  if (!values.is_array()) throw wrong(fmt::format("'{}' is no list", key));
  Eigen::VectorXd out(std::ssize(values));
  Index next = 0;
  for (const json& value : values) out[next++] = number(value, key);
  return out;
}

Eigen::VectorXd JsonReader::vector(const json& object, const char* key) const {
  return vector_of(at(object, key), key);
}

Eigen::VectorXd JsonReader::vector(const json& object, const char* key, Index size) const {
  Eigen::VectorXd out = vector(object, key);
  if (out.size() != size)
    throw wrong(fmt::format("'{}' holds {} numbers, not {}", key, out.size(), size));
  return out;
}

Eigen::MatrixXd JsonReader::matrix(const json& object, const char* key, Index columns) const {
  const json& list = array(object, key);
  Eigen::MatrixXd out(std::ssize(list), columns);
  Index next = 0;
  for (const json& row : list) {
    const Eigen::VectorXd values = vector_of(row, key);
    if (values.size() != columns)
      throw wrong(fmt::format("'{}' has a row of {} numbers, not {}", key, values.size(), columns));
    out.row(next++) = values;
  }
  return out;
}

Eigen::MatrixXd JsonReader::triangle(const json& object, const char* key, Index most) const {
  const Eigen::VectorXd packed = vector(object, key);
  Index size = 0;
  while (size * (size + 1) / 2 < packed.size()) ++size;
  if (size * (size + 1) / 2 != packed.size() || size > most)
    throw wrong(fmt::format("'{}' is no triangle of at most {} columns", key, most));
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(size, size);
  Index next = 0;
  for (Index j = 0; j < size; ++j) {
    for (Index i = 0; i <= j; ++i) out(i, j) = packed[next++];
  }
  return out;
}

}  // namespace kinescope
