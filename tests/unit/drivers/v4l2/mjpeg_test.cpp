#include "drivers/v4l2/mjpeg_decoder.hpp"

#include <gtest/gtest.h>
#include <poll.h>

#include "tests/unit/drivers/v4l2/jpeg_image.hpp"

namespace stillmap {
namespace {

constexpr int32_t kWaitMs = 20000;  ///< never needed

bool wait_for(const MjpegDecoder& decoder) {
  pollfd fd{decoder.descriptor(), POLLIN, 0};
  return ::poll(&fd, 1, kWaitMs) == 1;
}

MjpegDecoder::Job job_of(const std::vector<uint8_t>& image, uint32_t buffer) {
  return {image.data(), static_cast<uint32_t>(image.size()), buffer, 1000 + buffer};
}

TEST(MjpegDecoder, DecodesInOrderAndHandsThrough) {
  MjpegDecoder decoder(48, 64);
  const auto red = test::jpeg_image(64, 48, {200, 10, 10}), blue = test::jpeg_image(64, 48, {10, 10, 200});
  MjpegDecoder::Decoded first, second;
  EXPECT_FALSE(decoder.take(first));
  ASSERT_TRUE(decoder.submit(job_of(red, 3)));
  ASSERT_TRUE(decoder.submit(job_of(blue, 5)));
  ASSERT_TRUE(wait_for(decoder));
  ASSERT_TRUE(decoder.take(first));
  ASSERT_TRUE(wait_for(decoder));
  ASSERT_TRUE(decoder.take(second));
  EXPECT_FALSE(decoder.take(second));
  EXPECT_TRUE(first.good && second.good);
  EXPECT_EQ(first.job.buffer, 3u);
  EXPECT_EQ(second.job.buffer, 5u);
  EXPECT_EQ(second.job.stamp_ns, 1005);
  EXPECT_NEAR(decoder.image(first.slot).at(47, 63).r, 200, 3);
  EXPECT_NEAR(decoder.image(second.slot).at(0, 0).b, 200, 3);
  EXPECT_EQ(decoder.image(second.slot).cols, 64);
}

TEST(MjpegDecoder, BrokenImagesAreNotGood) {
  MjpegDecoder decoder(48, 64);
  const auto whole = test::jpeg_image(64, 48, {50, 60, 70}), larger = test::jpeg_image(66, 48, {1, 2, 3});
  const std::vector<uint8_t> cut(whole.begin(),
                                 whole.begin() + static_cast<std::ptrdiff_t>(whole.size() * 3 / 4)),
      noise(500, 0xa5), nothing(1);
  for (const auto* image : {&cut, &noise, &nothing, &larger}) {
    MjpegDecoder::Decoded decoded;
    ASSERT_TRUE(decoder.submit(job_of(*image, 0)));
    ASSERT_TRUE(wait_for(decoder));
    ASSERT_TRUE(decoder.take(decoded));
    EXPECT_FALSE(decoded.good);
    decoder.release(decoded.slot);
  }
  MjpegDecoder::Decoded decoded;
  ASSERT_TRUE(decoder.submit(job_of(whole, 0)));
  ASSERT_TRUE(wait_for(decoder));
  ASSERT_TRUE(decoder.take(decoded));
  EXPECT_TRUE(decoded.good);
}

TEST(MjpegDecoder, RefusesWhatItHasNoRoomFor) {
  MjpegDecoder decoder(48, 64);
  const auto image = test::jpeg_image(64, 48, {1, 2, 3});
  for (uint32_t i = 0; i < MjpegDecoder::kAtOnce; ++i) EXPECT_TRUE(decoder.submit(job_of(image, i)));
  EXPECT_FALSE(decoder.submit(job_of(image, 9)))
      << "decoded or not, they are on their way until they are taken";
  // Images that are taken and never released use up the memory.
  uint32_t held = 0;
  for (bool room = true; room && held < 100; room = decoder.submit(job_of(image, 0))) {
    ASSERT_TRUE(wait_for(decoder));
    MjpegDecoder::Decoded decoded;
    ASSERT_TRUE(decoder.take(decoded));
    ++held;
  }
  EXPECT_GE(held, FramePairing<int>::kPending);
  EXPECT_LT(held, 100u);
  decoder.release(0);
  EXPECT_TRUE(decoder.submit(job_of(image, 0)));
}

}  // namespace
}  // namespace stillmap
