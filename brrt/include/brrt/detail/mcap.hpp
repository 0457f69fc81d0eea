// An MCAP file that is being written: records, chunks, indexes and the summary, with all checksums.
// See https://mcap.dev/spec.
#pragma once

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "../events.hpp"
#include "json.hpp"

#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "brrt writes numbers as they are in memory, which must be little endian"
#endif

namespace brrt::detail {

/// Return the CRC-32 of some bytes, after those whose CRC-32 is `crc`, eight at a time.
inline std::uint32_t crc32(std::string_view data, std::uint32_t crc = 0) {
    using Table = std::array<std::array<std::uint32_t, 256>, 8>;
    static const Table table = [] {
        Table made{};
        for (std::uint32_t i = 0; i < 256; ++i) {
            std::uint32_t c = i;
            for (int bit = 0; bit < 8; ++bit) c = (c >> 1) ^ (c & 1 ? 0xEDB88320u : 0u);
            made[0][i] = c;
        }
        for (std::size_t i = 0; i < 256; ++i)
            for (std::size_t k = 1; k < 8; ++k)
                made[k][i] = (made[k - 1][i] >> 8) ^ made[0][made[k - 1][i] & 255];
        return made;
    }();
    crc = ~crc;
    const char *at = data.data();
    std::size_t left = data.size();
    for (; left >= 8; left -= 8, at += 8) {
        std::uint64_t word;
        std::memcpy(&word, at, 8);
        word ^= crc;
        crc = 0;
        for (std::size_t k = 0; k < 8; ++k) crc ^= table[7 - k][word >> (8 * k) & 255];
    }
    for (; left > 0; --left, ++at)
        crc = (crc >> 8) ^ table[0][(crc ^ static_cast<std::uint8_t>(*at)) & 255];
    return ~crc;
}

/// Bytes to which numbers are appended, little endian as MCAP has them.
struct Bytes : std::string {
    template <class T>
    Bytes &number(T value) {
        append(reinterpret_cast<const char *>(&value), sizeof value);
        return *this;
    }
    Bytes &text(std::string_view value) {
        number(static_cast<std::uint32_t>(value.size())).append(value);
        return *this;
    }
    Bytes &block(std::string_view value) {
        number(static_cast<std::uint64_t>(value.size())).append(value);
        return *this;
    }
};

/// Messages that are written together, and where in them each kind's are.
struct Chunk {
    Bytes raw;
    std::array<Bytes, kKindCount> index;  // pairs of a time and a place
    std::uint64_t count = 0, first_ns = 0, last_ns = 0;

    void clear() {
        raw.clear();
        for (Bytes &each : index) each.clear();
        count = first_ns = last_ns = 0;
    }
};

/// Return the channel of a kind, and its schema; 0 stands for no schema in MCAP.
inline std::uint16_t channel_of(std::size_t kind) { return static_cast<std::uint16_t>(kind + 1); }

/// An MCAP file of the ros2 profile. All methods throw std::system_error where it cannot be
/// written; what it holds then ends with the last whole chunk, and can be read.
class McapFile {
  public:
    using Texts = std::map<std::string, std::string>;

    /// Begin a file; nothing is written before `flush`.
    McapFile(std::string path, std::string_view library) : path_(std::move(path)) {
        pending_.append(kMagic);
        record(1, Bytes().text("ros2").text(library));
    }
    McapFile(const McapFile &) = delete;
    McapFile &operator=(const McapFile &) = delete;
    ~McapFile() {
        if (file_) std::fclose(file_);
    }

    /// Write named texts, with a checksum of brrt's own: MCAP has none for one record.
    void metadata(const std::string &name, Texts texts) {
        std::string dumped = "[";
        for (const auto &[key, value] : texts)
            dumped +=
                (dumped.size() > 1 ? ", [" : "[") + json_text(key) + ", " + json_text(value) + "]";
        texts["crc32"] = std::to_string(crc32(dumped + "]"));
        Bytes pairs;
        for (const auto &[key, value] : texts) pairs.text(key).text(utf8(value));
        const auto [at, size] = record(12, Bytes().text(name).text(pairs));
        metadata_indexes_.number<std::uint8_t>(13).block(
            Bytes().number(at).number(size).text(name));
        ++metadata_count_;
    }

    /// Write an attachment in JSON.
    void attach(std::string_view name, std::string_view data, std::uint64_t time_ns) {
        Bytes body;
        body.number(time_ns).number(time_ns).text(name).text("application/json").block(data);
        body.number(crc32(body));
        const auto [at, size] = record(9, body);
        Bytes entry;
        entry.number(at).number(size).number(time_ns).number(time_ns).number<std::uint64_t>(
            data.size());
        attachment_indexes_.number<std::uint8_t>(10).block(
            entry.text(name).text("application/json"));
        ++attachment_count_;
    }

    /// Declare the kinds of events; return the records that the first chunk begins with.
    Bytes declare(std::size_t dof) {
        for (std::size_t kind = 0; kind < kKindCount; ++kind) {
            std::string type = kKinds[kind].name, text = kKinds[kind].definition;
            type[0] = static_cast<char>(type[0] - 'a' + 'A');
            for (std::size_t at; (at = text.find('@')) != std::string::npos;)
                text.replace(at, 1, std::to_string(dof));
            const std::uint16_t number = channel_of(kind);
            Bytes schema, channel;
            schema.number(number).text("brrt_msgs/msg/" + type).text("ros2msg").text(text);
            channel.number(number).number(number).text(std::string("/brrt/") + kKinds[kind].name);
            channel.text("cdr").number<std::uint32_t>(0);
            schemas_.number<std::uint8_t>(3).block(schema);
            channels_.number<std::uint8_t>(4).block(channel);
        }
        Bytes declarations = schemas_;
        declarations.append(channels_);
        return declarations;
    }

    /// Write messages with their indexes, and hand them to the operating system.
    void chunk(const Chunk &chunk) {
        const std::uint64_t at = position(), size = chunk.raw.size();
        Bytes head;
        head.number(chunk.first_ns)
            .number(chunk.last_ns)
            .number(size)
            .number(crc32(chunk.raw))
            .text("");
        pending_.number<std::uint8_t>(6).number<std::uint64_t>(head.size() + 8 + size);
        pending_.append(head);
        pending_.block(chunk.raw);
        const std::uint64_t indexes_at = position(), length = indexes_at - at;
        Bytes places;
        for (std::size_t kind = 0; kind < kKindCount; ++kind) {
            const Bytes &index = chunk.index[kind];
            if (index.empty()) continue;
            counts_[kind] += index.size() / 16;
            places.number(channel_of(kind)).number(position());
            record(7, Bytes().number(channel_of(kind)).text(index));
        }
        Bytes entry;
        entry.number(chunk.first_ns).number(chunk.last_ns).number(at).number(length).text(places);
        entry.number(position() - indexes_at).text("").number(size).number(size);
        chunk_indexes_.number<std::uint8_t>(8).block(entry);
        if (chunk_count_++ == 0) first_ns_ = chunk.first_ns;
        last_ns_ = chunk.last_ns;
        flush();
    }

    /// Write the end of the data section, the summary and the footer, and close the file.
    void finish() {
        record(15, Bytes().number(crc32(pending_, crc_)));
        const std::uint64_t start = position();
        Bytes statistics, counts, summary, offsets;
        std::uint64_t messages = 0;
        for (std::size_t kind = 0; kind < kKindCount; ++kind) {
            messages += counts_[kind];
            if (counts_[kind]) counts.number(channel_of(kind)).number(counts_[kind]);
        }
        const auto kinds = static_cast<std::uint32_t>(kKindCount);
        Bytes body;
        body.number(messages)
            .number(static_cast<std::uint16_t>(kinds))
            .number(kinds)
            .number(attachment_count_);
        body.number(metadata_count_)
            .number(chunk_count_)
            .number(first_ns_)
            .number(last_ns_)
            .text(counts);
        statistics.number<std::uint8_t>(11).block(body);
        const std::pair<std::uint8_t, const Bytes *> groups[] = {
            {std::uint8_t{3}, &schemas_},
            {std::uint8_t{4}, &channels_},
            {std::uint8_t{11}, &statistics},
            {std::uint8_t{8}, &chunk_indexes_},
            {std::uint8_t{10}, &attachment_indexes_},
            {std::uint8_t{13}, &metadata_indexes_}};
        for (const auto &[opcode, group] : groups) {
            const std::uint64_t at = start + summary.size(), size = group->size();
            if (size)
                offsets.number<std::uint8_t>(14).block(
                    Bytes().number(opcode).number(at).number(size));
            summary.append(*group);
        }
        const std::uint64_t offsets_at = start + summary.size();
        summary.append(offsets);
        // Opcode, length, start of the summary and start of its offsets are under the CRC too.
        summary.number<std::uint8_t>(2).number<std::uint64_t>(20).number(start).number(offsets_at);
        summary.number(crc32(summary)).append(kMagic);
        pending_.append(summary);
        flush();
        std::FILE *file = std::exchange(file_, nullptr);
        if (std::fclose(file) != 0) fail();
    }

    /// Hand everything to the operating system; the first time, the file is created.
    void flush() {
        if (!file_) {
            file_ = std::fopen(path_.c_str(), "wb");
            if (!file_) fail();
            std::setvbuf(file_, nullptr, _IONBF, 0);
        }
        errno = 0;
        if (std::fwrite(pending_.data(), 1, pending_.size(), file_) != pending_.size()) {
            const int code = errno;
            // Half a record is taken back.
            std::fclose(std::exchange(file_, nullptr));
            std::error_code ignored;
            if (std::filesystem::is_regular_file(path_, ignored)) {
                if (written_) std::filesystem::resize_file(path_, written_, ignored);
                else std::filesystem::remove(path_, ignored);
            }
            errno = code;
            fail();
        }
        crc_ = crc32(pending_, crc_);
        written_ += pending_.size();
        pending_.clear();
    }

  private:
    static constexpr std::string_view kMagic{"\x89MCAP0\r\n", 8};

    [[noreturn]] void fail() const {
        throw std::system_error(errno ? errno : EIO, std::generic_category(),
                                "cannot write " + path_);
    }

    std::uint64_t position() const { return written_ + pending_.size(); }

    /// Append a record; return where it begins and how long it is.
    std::pair<std::uint64_t, std::uint64_t> record(std::uint8_t opcode, std::string_view body) {
        const std::uint64_t at = position();
        pending_.number(opcode).block(body);
        return {at, position() - at};
    }

    const std::string path_;
    std::FILE *file_ = nullptr;
    Bytes pending_, schemas_, channels_, chunk_indexes_, attachment_indexes_, metadata_indexes_;
    std::uint64_t written_ = 0, first_ns_ = 0, last_ns_ = 0;
    std::array<std::uint64_t, kKindCount> counts_{};
    std::uint32_t crc_ = 0, attachment_count_ = 0, metadata_count_ = 0, chunk_count_ = 0;
};

}  // namespace brrt::detail
