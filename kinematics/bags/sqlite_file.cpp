// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <fstream>
#include <utility>

#include <fmt/format.h>
#include <sqlite3.h>

#include "kinematics/bags/bag_files.h"
#include "kinematics/bags/unpack.h"
#include "kinematics/core/error.h"

namespace kinescope::bags {
namespace {

struct CloseSqlite {
  void operator()(sqlite3* database) const { sqlite3_close(database); }
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};

std::string_view bytes_of(sqlite3_stmt* row, int column) {
  const void* data = sqlite3_column_blob(row, column);
  const int size = sqlite3_column_bytes(row, column);
  if (data == nullptr || size <= 0) return {};
  return {static_cast<const char*>(data), static_cast<std::size_t>(size)};
}

/// SQLite makes files beside one that it may have to share. Where nobody writes (no log of changes
/// lies beside it) it is told that the file does not change.
std::string uri_of(const std::filesystem::path& file) {
  std::string out = "file:";
  for (const char c : file.string()) {
    const bool reserved = c == '%' || c == '?' || c == '#';
    out += reserved ? fmt::format("%{:02X}", static_cast<unsigned char>(c)) : std::string(1, c);
  }
  std::error_code error;
  const std::filesystem::path changes = file.string() + "-wal";
  return std::filesystem::exists(changes, error) ? out : out + "?immutable=1";
}

class SqliteFile final : public Reader {
 public:
  SqliteFile(const NamedFile& file, RowPacking packing) : name_(file.name), packing_(packing) {
    static_cast<void>(InputFile(file));  // missing, empty, may not be read
    sqlite3* opened = nullptr;
    const int status = sqlite3_open_v2(uri_of(file.path).c_str(), &opened,
                                       SQLITE_OPEN_READONLY | SQLITE_OPEN_URI, nullptr);
    database_.reset(opened);
    if (status != SQLITE_OK) refuse();
    // A schema from elsewhere must not run anything.
    sqlite3_db_config(opened, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
    sqlite3_db_config(opened, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
    sqlite3_db_config(opened, SQLITE_DBCONFIG_ENABLE_VIEW, 0, nullptr);
    const bool whole = is_readable();
    if (!whole) read_what_is_there();
    read_topics();
    // Sorting reads everything before it gives anything, and the index may be what is missing.
    messages_ = prepare(
        whole ? "SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp, messages.id"
              : "SELECT topic_id, timestamp, data FROM messages NOT INDEXED ORDER BY messages.id");
    warn_of_lost_changes(file.path);
  }

  const std::vector<Topic>& topics() const override { return table_.topics(); }
  const std::vector<std::string>& warnings() const override { return warnings_; }

  std::optional<Message> next() override {
    while (messages_) {
      const int status = sqlite3_step(messages_.get());
      if (status != SQLITE_ROW) {
        if (status != SQLITE_DONE) {
          warnings_.push_back(
              fmt::format("{}: the file is damaged ({}): what stands before is read", name_,
                          sqlite3_errmsg(database_.get())));
        }
        messages_.reset();
        break;
      }
      const auto number = static_cast<std::uint32_t>(sqlite3_column_int64(messages_.get(), 0));
      const auto topic = table_.index_of(number);
      if (!topic) continue;
      const std::int64_t received_ns = sqlite3_column_int64(messages_.get(), 1);
      const std::string_view data = bytes_of(messages_.get(), 2);
      if (packing_ == RowPacking::kNone) return Message{*topic, received_ns, data};
      Unpacked unpacked = unpack(Packing::kZstd, data);
      if (!unpacked.whole) {
        ++damaged_;
        if (damaged_ == 1) {
          warnings_.push_back(
              fmt::format("{}: messages that cannot be unpacked are left out, the first of {}",
                          name_, table_.topics()[*topic].name));
        }
        continue;
      }
      unpacked_ = std::move(unpacked.bytes);
      return Message{*topic, received_ns, unpacked_};
    }
    return std::nullopt;
  }

 private:
  using Statement = std::unique_ptr<sqlite3_stmt, CloseSqlite>;

  [[noreturn]] void refuse() const {
    throw bad_input(
        name_,
        fmt::format("is no bag of ROS 2 in sqlite3 ({})",
                    database_ ? sqlite3_errmsg(database_.get()) : "no memory"),
        "check what it is, or copy it again; a file NAME.db3-wal beside it belongs to it");
  }

  /// False for a file that is shorter than it says.
  [[nodiscard]] bool is_readable() const {
    sqlite3_stmt* made = nullptr;
    const int status =
        sqlite3_prepare_v2(database_.get(), "SELECT id FROM topics", -1, &made, nullptr);
    sqlite3_finalize(made);
    return status != SQLITE_CORRUPT;
  }

  /// sqlite3 refuses a file that is cut off unless its schema may be repaired; this one is opened
  /// for reading only.
  void read_what_is_there() {
    sqlite3_db_config(database_.get(), SQLITE_DBCONFIG_DEFENSIVE, 0, nullptr);
    sqlite3_db_config(database_.get(), SQLITE_DBCONFIG_WRITABLE_SCHEMA, 1, nullptr);
    warnings_.push_back(fmt::format(
        "{}: the file is cut off (the copy, or the recording, was broken off): what is there is "
        "read",
        name_));
  }

  /// A recorder that writes changes beside the file brings them into it when it ends, and then
  /// writes metadata.yaml.
  void warn_of_lost_changes(const std::filesystem::path& file) {
    constexpr std::size_t kVersionAt = 18;  // of the header: 2 is a log of changes (WAL)
    std::ifstream stream(file, std::ios::binary);
    std::string header(kVersionAt + 1, '\0');
    stream.read(header.data(), static_cast<std::streamsize>(header.size()));
    std::error_code error;
    const bool closed = std::filesystem::exists(file.parent_path() / "metadata.yaml", error);
    const bool changes = std::filesystem::exists(file.string() + "-wal", error);
    if (!stream || header[kVersionAt] != 2 || closed || changes) return;
    warnings_.push_back(
        fmt::format("{}: its recorder kept the last messages in {}-wal, which is not there: if it "
                    "was broken off (no metadata.yaml), they are missing; copy that file, too",
                    name_, std::filesystem::path(name_).filename().string()));
  }

  Statement prepare(const char* query) {
    sqlite3_stmt* made = nullptr;
    if (sqlite3_prepare_v2(database_.get(), query, -1, &made, nullptr) != SQLITE_OK) refuse();
    return Statement(made);
  }

  void read_topics() {
    const Statement rows =
        prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY id");
    int status = sqlite3_step(rows.get());
    for (; status == SQLITE_ROW; status = sqlite3_step(rows.get())) {
      const auto text = [&](int column) { return std::string(bytes_of(rows.get(), column)); };
      const std::string encoding = text(3);
      table_.add(static_cast<std::uint32_t>(sqlite3_column_int64(rows.get(), 0)),
                 {text(1), plain_type(text(2)), encoding, encoding_of(encoding)});
    }
    if (status != SQLITE_DONE) refuse();
  }

  std::string name_;
  RowPacking packing_;
  std::unique_ptr<sqlite3, CloseSqlite> database_;
  Statement messages_;
  TopicTable table_;
  std::string unpacked_;
  int damaged_ = 0;
  std::vector<std::string> warnings_;
};

}  // namespace

std::unique_ptr<Reader> open_sqlite(const NamedFile& file, RowPacking packing) {
  return std::make_unique<SqliteFile>(file, packing);
}

}  // namespace kinescope::bags
