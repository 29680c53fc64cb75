// SPDX-License-Identifier: Apache-2.0
#include "kinematics/parquet/thrift_reader.h"

#include <utility>

#include "kinematics/parquet/damage.h"

namespace kinescope::parquet {
namespace {

constexpr int kDeepest = 32;

Damage bad_metadata() { return {"its metadata is no metadata of Parquet"}; }

ThriftReader::Type type_of(unsigned number) {
  if (number > static_cast<unsigned>(ThriftReader::Type::kStruct)) throw bad_metadata();
  return static_cast<ThriftReader::Type>(number);
}

}  // namespace

ThriftReader::Level::Level(ThriftReader& reader) : reader_(reader) {
  if (reader.level_ == kDeepest) throw bad_metadata();
  ++reader.level_;
}

std::string_view ThriftReader::take(std::uint64_t size) {
  if (size > bytes_.size() - at_) throw Damage{"its metadata is cut off"};
  const std::string_view out = bytes_.substr(at_, static_cast<std::size_t>(size));
  at_ += out.size();
  return out;
}

std::uint8_t ThriftReader::byte() { return static_cast<std::uint8_t>(take(1).front()); }

std::uint64_t ThriftReader::varint() {
  std::uint64_t out = 0;
  for (unsigned shift = 0; shift < 64; shift += 7) {
    const std::uint8_t part = byte();
    out |= static_cast<std::uint64_t>(part & 0x7FU) << shift;
    if ((part & 0x80U) == 0) return out;
  }
  throw bad_metadata();
}

std::int64_t ThriftReader::zigzag() {
  const std::uint64_t coded = varint();
  return static_cast<std::int64_t>((coded >> 1U) ^ (0 - (coded & 1U)));
}

std::optional<ThriftReader::Field> ThriftReader::next_field(int& last) {
  const unsigned head = byte();
  const Type type = type_of(head & 0x0FU);
  if (type == Type::kStop) return std::nullopt;
  const unsigned step = head >> 4U;
  const std::int64_t id = step == 0 ? zigzag() : last + static_cast<std::int64_t>(step);
  constexpr std::int64_t kMostFields = 1 << 15;
  if (id <= 0 || id >= kMostFields) throw bad_metadata();
  last = static_cast<int>(id);
  return Field{last, type};
}

std::pair<ThriftReader::Type, std::size_t> ThriftReader::list_header() {
  constexpr unsigned kLong = 15;
  const unsigned head = byte();
  const std::uint64_t size = head >> 4U == kLong ? varint() : head >> 4U;
  // An element takes a byte at least.
  if (size > bytes_.size() - at_) throw Damage{"its metadata is cut off"};
  return {type_of(head & 0x0FU), static_cast<std::size_t>(size)};
}

std::size_t ThriftReader::list_of(const Field& field, Type type) {
  if (field.type != Type::kList) throw bad_metadata();
  const auto [found, size] = list_header();
  if (found != type && size > 0) throw bad_metadata();
  return size;
}

std::int64_t ThriftReader::integer(const Field& field) {
  switch (field.type) {
    case Type::kByte:
      return static_cast<std::int8_t>(byte());
    case Type::kI16:
    case Type::kI32:
    case Type::kI64:
      return zigzag();
    default:
      throw bad_metadata();
  }
}

std::int64_t ThriftReader::i32() { return zigzag(); }

bool ThriftReader::boolean(const Field& field) const {
  if (field.type != Type::kTrue && field.type != Type::kFalse) throw bad_metadata();
  return field.type == Type::kTrue;
}

std::string_view ThriftReader::binary(const Field& field) {
  if (field.type != Type::kBinary) throw bad_metadata();
  return binary();
}

std::string_view ThriftReader::binary() { return take(varint()); }

void ThriftReader::skip_elements(Type type, std::size_t count) {
  const Level level(*this);
  for (std::size_t i = 0; i < count; ++i) {
    // Of a list a truth value is a byte; of a struct it is in the field's type.
    if (type == Type::kTrue || type == Type::kFalse) {
      static_cast<void>(byte());
    } else {
      skip(type);
    }
  }
}

void ThriftReader::skip_map() {
  const Level level(*this);
  const std::uint64_t size = varint();
  if (size == 0) return;
  const unsigned types = byte();
  if (size > bytes_.size() - at_) throw Damage{"its metadata is cut off"};
  for (std::uint64_t i = 0; i < size; ++i) {
    skip_elements(type_of(types >> 4U), 1);
    skip_elements(type_of(types & 0x0FU), 1);
  }
}

void ThriftReader::skip(Type type) {
  switch (type) {
    case Type::kTrue:
    case Type::kFalse:
      return;
    case Type::kByte:
      static_cast<void>(byte());
      return;
    case Type::kI16:
    case Type::kI32:
    case Type::kI64:
      static_cast<void>(varint());
      return;
    case Type::kDouble:
      static_cast<void>(take(sizeof(double)));
      return;
    case Type::kBinary:
      static_cast<void>(binary());
      return;
    case Type::kList:
    case Type::kSet: {
      const auto [element, size] = list_header();
      skip_elements(element, size);
      return;
    }
    case Type::kMap:
      skip_map();
      return;
    case Type::kStruct:
      each_field([](const Field&) { return false; });
      return;
    case Type::kStop:
      break;
  }
  throw bad_metadata();
}

}  // namespace kinescope::parquet
