// ROS 2 bags of the storage `sqlite3`: a table `topics`, and `messages` with the serialised bytes.

#include <algorithm>
#include <map>
#include <memory>
#include <string_view>
#include <system_error>
#include <utility>

#include <sqlite3.h>

#include "rotodom/sequence/bag/bag_reader.h"

namespace rotslam {
namespace {

namespace fs = std::filesystem;

using Database = std::unique_ptr<sqlite3, int (*)(sqlite3*)>;
using Statement = std::unique_ptr<sqlite3_stmt, int (*)(sqlite3_stmt*)>;
using Blob = std::unique_ptr<sqlite3_blob, int (*)(sqlite3_blob*)>;

// The path as an SQLite URI.
std::string SqliteUri(const fs::path& file, bool is_immutable) {
  constexpr const char* kHex = "0123456789abcdef";
  std::string uri = "file:";
  for (const char c : fs::absolute(file).string()) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '%' || c == '?' || c == '#' || byte < 0x20) {
      uri += {'%', kHex[byte >> 4], kHex[byte & 15]};
    } else {
      uri += c;
    }
  }
  return uri + (is_immutable ? "?immutable=1" : "?mode=ro");
}

class SqliteBag : public BagReader {
 public:
  SqliteBag(const fs::path& path, const BagFilter& wanted) : BagReader(path, wanted) {
    std::error_code error;
    size_ = fs::file_size(path, error);
    // A journal that was not written back is part of the bag; without one SQLite is told to leave
    // no file of its own beside it.
    const fs::path journal = path.string() + "-wal";
    const bool has_journal = fs::exists(journal, error) && fs::file_size(journal, error) > 0;
    sqlite3* opened = nullptr;
    const int status = sqlite3_open_v2(SqliteUri(path, !has_journal).c_str(),
                                       &opened,
                                       SQLITE_OPEN_READONLY | SQLITE_OPEN_URI,
                                       nullptr);
    database_.reset(opened);
    if (status != SQLITE_OK) FailAsSqlite();
    // What a damaged schema could make it run.
    sqlite3_db_config(opened, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
    sqlite3_db_config(opened, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
    CheckTables();
    ReadTopics();
    ReadEntries();
    Finish();
  }

 private:
  std::string ReadStored(const BagEntry& entry) override {
    if (!Seek(static_cast<std::int64_t>(entry.offset))) FailAsSqlite();
    return BytesOfBlob(entry.size);
  }

  [[noreturn]] void FailAsSqlite() const {
    Fail(std::string("SQLite says: ") +
         (database_ ? sqlite3_errmsg(database_.get()) : "out of memory"));
  }

  Statement Prepare(const char* query) const {
    sqlite3_stmt* statement = nullptr;
    if (sqlite3_prepare_v2(database_.get(), query, -1, &statement, nullptr) != SQLITE_OK) {
      FailAsSqlite();
    }
    return {statement, sqlite3_finalize};
  }

  void CheckTables() const {
    const Statement tables = Prepare(
        "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN ('topics', "
        "'messages') AND sql NOT LIKE 'CREATE VIRTUAL%'");
    if (sqlite3_step(tables.get()) != SQLITE_ROW) FailAsSqlite();
    if (sqlite3_column_int(tables.get(), 0) != 2) {
      Fail("is an SQLite file, but no ROS 2 bag: it lacks the tables 'topics' and 'messages'");
    }
  }

  void ReadTopics() {
    const auto text = [](const Statement& row, int column) {
      const auto* letters = reinterpret_cast<const char*>(sqlite3_column_text(row.get(), column));
      return std::string(letters == nullptr ? "" : letters);
    };
    const Statement row = Prepare("SELECT id, name, type, serialization_format FROM topics");
    int status = SQLITE_OK;
    while ((status = sqlite3_step(row.get())) == SQLITE_ROW) {
      std::string type = text(row, 2);
      const std::size_t middle = type.find("/msg/");
      if (middle != std::string::npos) type.erase(middle, 4);
      topic_of_id_[sqlite3_column_int64(row.get(), 0)] =
          AddTopic({text(row, 1), std::move(type), text(row, 3)});
    }
    if (status != SQLITE_DONE) FailAsSqlite();
  }

  void ReadEntries() {
    const Statement row = Prepare("SELECT rowid, topic_id, timestamp, length(data) FROM messages");
    int status = SQLITE_OK;
    while ((status = sqlite3_step(row.get())) == SQLITE_ROW) {
      const auto topic = topic_of_id_.find(sqlite3_column_int64(row.get(), 1));
      if (topic == topic_of_id_.end()) {
        AddMessageWithoutTopic();
        continue;
      }
      BagEntry entry;
      entry.topic = topic->second;
      entry.time_ns = sqlite3_column_int64(row.get(), 2);
      entry.size = static_cast<std::uint64_t>(sqlite3_column_int64(row.get(), 3));
      entry.offset = static_cast<std::uint64_t>(sqlite3_column_int64(row.get(), 0));
      std::string head;
      if (IsWanted(entry.topic)) {
        if (!Seek(sqlite3_column_int64(row.get(), 0))) {
          ++num_unreadable_;
          continue;
        }
        head = BytesOfBlob(std::min<std::uint64_t>(entry.size, NumFirstBytes(entry.size)));
      }
      AddMessage(entry, head);
    }
    if (status != SQLITE_DONE) {
      notes_.push_back(
          std::string("the messages behind a damaged place are left out; SQLite says: ") +
          sqlite3_errmsg(database_.get()));
    }
    if (num_unreadable_ > 0) {
      notes_.push_back("messages that are left out: " + std::to_string(num_unreadable_) +
                       ", which SQLite cannot read");
    }
  }

  // Goes to the bytes of a message; false when it cannot.
  bool Seek(std::int64_t rowid) {
    if (blob_ && sqlite3_blob_reopen(blob_.get(), rowid) == SQLITE_OK) return true;
    // One that failed stays useless.
    blob_.reset();
    sqlite3_blob* opened = nullptr;
    const int status =
        sqlite3_blob_open(database_.get(), "main", "messages", "data", rowid, 0, &opened);
    blob_.reset(opened);
    return status == SQLITE_OK;
  }

  // The first bytes of the message that Seek found.
  std::string BytesOfBlob(std::uint64_t size) {
    const auto there = static_cast<std::uint64_t>(sqlite3_blob_bytes(blob_.get()));
    if (size > there || there > size_) Fail("a message is longer than the file can hold");
    std::string bytes(static_cast<std::size_t>(size), '\0');
    if (size > 0 &&
        sqlite3_blob_read(blob_.get(), bytes.data(), static_cast<int>(size), 0) != SQLITE_OK) {
      FailAsSqlite();
    }
    return bytes;
  }

  std::uint64_t size_ = 0;
  Database database_{nullptr, sqlite3_close};
  Blob blob_{nullptr, sqlite3_blob_close};
  std::map<std::int64_t, std::size_t> topic_of_id_;
  std::int64_t num_unreadable_ = 0;
};

}  // namespace

std::unique_ptr<BagReader> OpenSqliteBag(const fs::path& file, const BagFilter& wanted) {
  return std::make_unique<SqliteBag>(file, wanted);
}

}  // namespace rotslam
