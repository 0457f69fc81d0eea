// Events on their way to the file: messages are laid out by the caller, and written by a thread.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <cstring>
#include <deque>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

#include "mcap.hpp"

namespace brrt::detail {

/// Lays out the fields of one message, by CDR: each is aligned to its own size.
class Fields {
  public:
    explicit Fields(char *body) : body_(body), at_(body) {}

    template <class T>
    Fields &add(T value) {
        return array(&value, 1);
    }
    template <class T>
    Fields &array(const T *values, std::size_t count) {
        const auto used = static_cast<std::size_t>(at_ - body_);
        at_ += (sizeof(T) - used % sizeof(T)) % sizeof(T);
        std::memcpy(at_, values, count * sizeof(T));
        at_ += count * sizeof(T);
        return *this;
    }
    const char *end() const { return at_; }

  private:
    char *body_, *at_;
};

/// Collects messages into chunks, which a thread writes: when they are full, and else every 0.2 s,
/// so that a killed process loses less than half a second.
class Writer {
  public:
    using OnError = std::function<void(const std::string &)>;
    using Lock = std::unique_lock<std::mutex>;

    /// Start the thread. The first chunk begins with `declarations`. `on_error` is called once,
    /// from it or from `close`, if the file cannot be written any more; what comes then is dropped.
    Writer(std::unique_ptr<McapFile> file, const Bytes &declarations, std::uint64_t epoch_ns,
           OnError on_error)
        : file_(std::move(file)), epoch_ns_(epoch_ns), on_error_(std::move(on_error)) {
        chunk_.raw = declarations;
        thread_ = std::thread([this] { work(); });
    }
    Writer(const Writer &) = delete;
    Writer &operator=(const Writer &) = delete;
    ~Writer() { stop(); }

    /// Lock the writer; wait while more chunks are full than may wait.
    Lock lock() {
        Lock lock(mutex_);
        if (chunk_.raw.size() >= kChunkBytes) {
            full_.push_back(take());
            changed_.notify_all();
            changed_.wait(lock, [this] { return full_.size() <= kMostChunks || !error_.empty(); });
        }
        return lock;
    }

    /// Append a message, under a lock.
    ///
    /// @param room Bytes of its fields, padding included, or more.
    /// @param fill Called with `Fields`, which begin with the iteration.
    template <class Fill>
    void put(Kind kind, std::int64_t t, std::int64_t iteration, std::size_t room, Fill &&fill) {
        const std::uint64_t seq = sequence_++;
        if (!error_.empty()) return;
        constexpr std::size_t kHead = 31, kEncapsulation = 4;
        const std::size_t begin = chunk_.raw.size();
        chunk_.raw.resize(begin + kHead + kEncapsulation + 8 + room);
        char *const record = &chunk_.raw[begin], *const body = record + kHead + kEncapsulation;
        Fields fields(body);
        fields.add<std::uint64_t>(static_cast<std::uint64_t>(iteration));
        fill(fields);
        const auto size = static_cast<std::size_t>(fields.end() - record);
        chunk_.raw.resize(begin + size);

        const auto kind_number = static_cast<std::size_t>(kind);
        const std::uint64_t time = epoch_ns_ + static_cast<std::uint64_t>(t), place = begin;
        char *at = record;
        const auto head = [&at](auto value) {
            std::memcpy(at, &value, sizeof value);
            at += sizeof value;
        };
        head(std::uint8_t{5});  // a message record
        head(static_cast<std::uint64_t>(size - 9));
        head(channel_of(kind_number));
        head(static_cast<std::uint32_t>(seq));
        head(time);
        head(time);
        head(std::uint32_t{0x100});  // CDR, little endian
        chunk_.index[kind_number].number(time).number(place);
        if (chunk_.count++ == 0) chunk_.first_ns = time;
        chunk_.last_ns = time;
    }

    /// Wait until all messages so far are handed to the operating system.
    void flush() {
        Lock lock(mutex_);
        if (chunk_.count) full_.push_back(take());
        changed_.notify_all();
        changed_.wait(lock, [this] { return (full_.empty() && !writing_) || !error_.empty(); });
    }

    /// Write the rest, the result and the end of the file. No messages may follow.
    void close(const McapFile::Texts &result) {
        stop();
        if (!file_) return;
        attempt([&] {
            file_->metadata("brrt.result", result);
            file_->finish();
        });
        file_.reset();
    }

    /// What went wrong with the file; empty if nothing did.
    std::string error() const {
        Lock lock(mutex_);
        return error_;
    }

    std::uint64_t count() const { return sequence_; }  // under a lock

  private:
    static constexpr std::size_t kChunkBytes = 1 << 18, kMostChunks = 32;
    static constexpr std::chrono::milliseconds kLate{200};

    Chunk take() { return std::exchange(chunk_, std::exchange(spare_, {})); }

    void work() {
        Lock lock(mutex_);
        for (;;) {
            changed_.wait_for(lock, kLate, [this] { return stopping_ || !full_.empty(); });
            if (full_.empty() && chunk_.count) full_.push_back(take());
            writing_ = true;
            while (!full_.empty()) {
                Chunk chunk = std::move(full_.front());
                full_.pop_front();
                changed_.notify_all();
                lock.unlock();
                attempt([&] { file_->chunk(chunk); });
                chunk.clear();
                lock.lock();
                spare_ = std::move(chunk);  // its memory is used again
            }
            writing_ = false;
            changed_.notify_all();
            if (stopping_ && chunk_.count == 0) return;
        }
    }

    /// Write something, unless the file has failed; messages after missing ones cannot be read.
    template <class Write>
    void attempt(Write &&write) {
        if (failed_) return;
        std::string why = "no memory";
        try {
            return write();
        } catch (const std::exception &error) {
            why = error.what();
        }
        failed_ = true;
        {
            Lock lock(mutex_);
            error_ = why;
        }
        changed_.notify_all();
        try {
            if (on_error_) on_error_(why);
        } catch (...) {  // a report that fails must not end the process
        }
    }

    void stop() {
        {
            Lock lock(mutex_);
            stopping_ = true;
        }
        changed_.notify_all();
        if (thread_.joinable()) thread_.join();
    }

    std::unique_ptr<McapFile> file_;
    const std::uint64_t epoch_ns_;
    const OnError on_error_;
    mutable std::mutex mutex_;
    std::condition_variable changed_;
    Chunk chunk_, spare_;
    std::deque<Chunk> full_;
    std::uint64_t sequence_ = 0;
    std::string error_;
    bool writing_ = false, stopping_ = false;
    bool failed_ = false;  // of the thread that writes
    std::thread thread_;
};

}  // namespace brrt::detail
