#include "drivers/v4l2/mjpeg_decoder.hpp"

#include <sys/eventfd.h>
#include <turbojpeg.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <memory>

namespace stillmap {
namespace {

constexpr std::chrono::milliseconds kLookForStop{50};

bool decode(tjhandle decoder, const MjpegDecoder::Job& job, ImageView<Rgb8> out) {
  int width = 0, height = 0, subsampling = 0, colour_space = 0;
  if (!decoder ||
      tjDecompressHeader3(decoder, job.data, job.bytes, &width, &height, &subsampling, &colour_space) != 0 ||
      width != out.cols || height != out.rows)
    return false;
  // Without the flag the library fills what is missing of a cut image with grey.
  const int flags = TJFLAG_STOPONWARNING | TJFLAG_LIMITSCANS;
  return tjDecompress2(decoder, job.data, job.bytes, reinterpret_cast<unsigned char*>(out.data), out.cols,
                       out.pitch * static_cast<int>(sizeof(Rgb8)), out.rows, TJPF_RGB, flags) == 0;
}

}  // namespace

MjpegDecoder::MjpegDecoder(int32_t rows, int32_t cols)
    : rows_(rows),
      cols_(cols),
      event_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC | EFD_SEMAPHORE)),
      memory_(static_cast<size_t>(kSlots) * static_cast<size_t>(rows) * static_cast<size_t>(cols)),
      thread_([this] { work(); }) {}

MjpegDecoder::~MjpegDecoder() {
  stop_.store(true, std::memory_order_relaxed);
  thread_.join();
  if (event_ >= 0) ::close(event_);
}

bool MjpegDecoder::submit(const Job& job) {
  const auto free = std::find(taken_.begin(), taken_.end(), false);
  if (event_ < 0 || free == taken_.end() || on_their_way_ == kAtOnce) return false;
  if (!jobs_.push({job, static_cast<uint32_t>(free - taken_.begin()), false})) return false;
  *free = true;
  ++on_their_way_;
  return true;
}

bool MjpegDecoder::take(Decoded& decoded) {
  // An event comes behind its image, which so is there; `pop` may fail all the same while the next one is put
  // in.
  constexpr std::chrono::milliseconds kMost{100};
  uint64_t one = 0;
  if (::read(event_, &one, sizeof(one)) < 0 || !done_.pop_within(decoded, kMost)) return false;
  --on_their_way_;
  return true;
}

ImageView<const Rgb8> MjpegDecoder::image(uint32_t slot) const {
  const size_t pixels = static_cast<size_t>(rows_) * static_cast<size_t>(cols_);
  return {memory_.data() + slot * pixels, rows_, cols_, cols_};
}

void MjpegDecoder::work() {
  const std::unique_ptr<void, decltype(&tjDestroy)> decoder(tjInitDecompress(), tjDestroy);
  const size_t pixels = static_cast<size_t>(rows_) * static_cast<size_t>(cols_);
  while (!stop_.load(std::memory_order_relaxed)) {
    Decoded next;
    if (!jobs_.pop_within(next, kLookForStop)) continue;
    next.good = decode(decoder.get(), next.job, {memory_.data() + next.slot * pixels, rows_, cols_, cols_});
    done_.push(next);  // as many places as jobs can be on their way
    const uint64_t one = 1;
    if (::write(event_, &one, sizeof(one)) < 0) return;  // cannot be: the counter never exceeds kAtOnce
  }
}

}  // namespace stillmap
