#include "runtime/image/image_file.hpp"

#include <gtest/gtest.h>
#include <spng.h>
#include <turbojpeg.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <random>

#include "tests/support/contains.hpp"
#include "tests/support/temp_dir.hpp"
#include "tests/support/test_image.hpp"

namespace stillmap {
namespace {

using test::contains;
using test::TempDir;
using test::TestImage;

/// Bytes of a PNG of any kind, made by the library itself.
std::string png_bytes(uint32_t width, uint32_t height, uint8_t bits, uint8_t colour_type,
                      const std::vector<uint8_t>& pixels) {
  spng_ctx* context = spng_ctx_new(SPNG_CTX_ENCODER);
  spng_set_option(context, SPNG_ENCODE_TO_BUFFER, 1);
  spng_ihdr head = {width, height, bits, colour_type, 0, 0, 0};
  EXPECT_EQ(spng_set_ihdr(context, &head), 0);
  if (colour_type == SPNG_COLOR_TYPE_INDEXED) {
    spng_plte palette = {};
    palette.n_entries = 2;
    palette.entries[0] = {10, 20, 30, 255};
    palette.entries[1] = {200, 100, 50, 255};
    EXPECT_EQ(spng_set_plte(context, &palette), 0);
  }
  EXPECT_EQ(spng_encode_image(context, pixels.data(), pixels.size(), SPNG_FMT_PNG, SPNG_ENCODE_FINALIZE), 0);
  size_t count = 0;
  int code = 0;
  void* buffer = spng_get_png_buffer(context, &count, &code);
  std::string bytes(static_cast<const char*>(buffer), count);
  std::free(buffer);
  spng_ctx_free(context);
  return bytes;
}

std::string jpeg_bytes(const TestImage<Rgb8>& image) {
  const ImageView<const Rgb8> view = image.view();
  const tjhandle encoder = tjInitCompress();
  unsigned char* buffer = nullptr;
  unsigned long count = 0;
  EXPECT_EQ(tjCompress2(encoder, reinterpret_cast<const unsigned char*>(view.data), view.cols, view.pitch * 3,
                        view.rows, TJPF_RGB, &buffer, &count, TJSAMP_444, 95, 0),
            0);
  std::string bytes(reinterpret_cast<const char*>(buffer), count);
  tjFree(buffer);
  tjDestroy(encoder);
  return bytes;
}

template <class A, class B>
void expect_same_pixels(ImageView<A> a, ImageView<B> b) {
  ASSERT_EQ(a.rows, b.rows);
  ASSERT_EQ(a.cols, b.cols);
  for (int32_t r = 0; r < a.rows; ++r)
    ASSERT_EQ(std::memcmp(a.row(r), b.row(r), static_cast<size_t>(a.cols) * sizeof(A)), 0) << "row " << r;
}

TEST(ImageFile, DepthComesBackBitForBit) {
  const TempDir dir;
  const TestImage<uint16_t> image = test::depth_pattern(48, 64);
  ASSERT_TRUE(write_png16(dir / "depth.png", image.view()));
  TestImage<uint16_t> back(48, 64);
  const Result<Done> done = read_png16(dir / "depth.png", back.view());
  ASSERT_TRUE(done) << done.error();
  expect_same_pixels(image.view(), back.view());
  EXPECT_FALSE(std::filesystem::exists(dir / "depth.png.part"));
}

TEST(ImageFile, ColourComesBackBitForBit) {
  const TempDir dir;
  const TestImage<Rgb8> image = test::colour_pattern(48, 64);
  ASSERT_TRUE(write_png(dir / "colour.png", image.view()));
  TestImage<Rgb8> back(48, 64);
  ASSERT_TRUE(read_colour(dir / "colour.png", back.view()));
  expect_same_pixels(image.view(), back.view());
}

TEST(ImageFile, RowsWithMarginsAreReadAndWritten) {
  const TempDir dir;
  TestImage<uint16_t> image(10, 20, 4), back(10, 20, 7);
  for (int32_t r = 0; r < 10; ++r)
    for (int32_t c = 0; c < 24; ++c)
      image.view().data[r * 24 + c] = static_cast<uint16_t>(c < 20 ? r * 20 + c : 9999);
  ASSERT_TRUE(write_png16(dir / "depth.png", image.view()));
  ASSERT_TRUE(read_png16(dir / "depth.png", back.view()));
  expect_same_pixels(image.view(), back.view());
  for (int32_t r = 0; r < 10; ++r)
    for (int32_t c = 20; c < 27; ++c)
      EXPECT_EQ(back.view().data[r * 27 + c], 0) << "the margin was written to";
}

TEST(ImageFile, GreyIsReadAsColour) {
  const TempDir dir;
  TestImage<uint8_t> image(8, 16);
  for (int32_t i = 0; i < 128; ++i) image.view().data[i] = static_cast<uint8_t>(2 * i);
  ASSERT_TRUE(write_png_grey(dir / "mask.png", image.view()));
  const Result<ImageInfo> info = image_info(dir / "mask.png");
  ASSERT_TRUE(info);
  EXPECT_TRUE(info->grey);
  EXPECT_EQ(info->bits, 8);
  TestImage<Rgb8> back(8, 16);
  ASSERT_TRUE(read_colour(dir / "mask.png", back.view()));
  for (int32_t i = 0; i < 128; ++i) {
    EXPECT_EQ(back.view().data[i].r, 2 * i);
    EXPECT_EQ(back.view().data[i].b, 2 * i);
  }
}

TEST(ImageFile, AlphaAndPalettesAreRead) {
  const TempDir dir;
  TestImage<Rgb8> back(1, 2);
  test::write_text(dir / "rgba.png",
                   png_bytes(2, 1, 8, SPNG_COLOR_TYPE_TRUECOLOR_ALPHA, {1, 2, 3, 0, 4, 5, 6, 255}));
  ASSERT_TRUE(read_colour(dir / "rgba.png", back.view()));
  EXPECT_EQ(back.view().at(0, 0).b, 3);
  EXPECT_EQ(back.view().at(0, 1).r, 4);
  test::write_text(dir / "palette.png", png_bytes(2, 1, 8, SPNG_COLOR_TYPE_INDEXED, {1, 0}));
  ASSERT_TRUE(read_colour(dir / "palette.png", back.view()));
  EXPECT_EQ(back.view().at(0, 0).r, 200);
  EXPECT_EQ(back.view().at(0, 1).b, 30);
}

TEST(ImageFile, JpegIsReadWhateverItsName) {
  const TempDir dir;
  TestImage<Rgb8> image(32, 48);
  for (int32_t i = 0; i < 32 * 48; ++i) image.view().data[i] = {200, 100, 50};
  test::write_text(dir / "really_a_jpeg.png", jpeg_bytes(image));
  const Result<ImageInfo> info = image_info(dir / "really_a_jpeg.png");
  ASSERT_TRUE(info) << info.error();
  EXPECT_EQ(info->cols, 48);
  EXPECT_EQ(info->rows, 32);
  TestImage<Rgb8> back(32, 48, 3);
  ASSERT_TRUE(read_colour(dir / "really_a_jpeg.png", back.view()));
  for (int32_t r = 0; r < 32; ++r) {
    EXPECT_NEAR(back.view().at(r, 47).r, 200, 3);
    EXPECT_NEAR(back.view().at(r, 47).g, 100, 3);
    EXPECT_NEAR(back.view().at(r, 47).b, 50, 3);
  }
}

TEST(ImageFile, WrongSizeNamesExpectedAndFound) {
  const TempDir dir;
  ASSERT_TRUE(write_png16(dir / "depth.png", test::depth_pattern(48, 64).view()));
  test::write_text(dir / "colour.jpg", jpeg_bytes(test::colour_pattern(48, 64)));
  TestImage<uint16_t> depth(48, 63);
  const Result<Done> depth_done = read_png16(dir / "depth.png", depth.view());
  ASSERT_FALSE(depth_done);
  EXPECT_TRUE(contains(depth_done.error(), "depth.png: expected 63x48 pixels, found 64x48 pixels"))
      << depth_done.error();
  TestImage<Rgb8> colour(24, 64);
  const Result<Done> colour_done = read_colour(dir / "colour.jpg", colour.view());
  ASSERT_FALSE(colour_done);
  EXPECT_TRUE(contains(colour_done.error(), "expected 64x24 pixels, found 64x48 pixels"))
      << colour_done.error();
}

TEST(ImageFile, DepthMustHaveSixteenBits) {
  const TempDir dir;
  ASSERT_TRUE(write_png_grey(dir / "preview.png", TestImage<uint8_t>(4, 4).view()));
  ASSERT_TRUE(write_png(dir / "colour.png", TestImage<Rgb8>(4, 4).view()));
  TestImage<uint16_t> depth(4, 4);
  const Result<Done> preview = read_png16(dir / "preview.png", depth.view());
  ASSERT_FALSE(preview);
  EXPECT_TRUE(contains(preview.error(), "expected a depth image of 16-bit grey (PNG), found 8-bit grey"))
      << preview.error();
  const Result<Done> colour = read_png16(dir / "colour.png", depth.view());
  ASSERT_FALSE(colour);
  EXPECT_TRUE(contains(colour.error(), "found 8-bit colour")) << colour.error();
}

TEST(ImageFile, DepthIsNotTakenForColour) {
  const TempDir dir;
  ASSERT_TRUE(write_png16(dir / "depth.png", test::depth_pattern(4, 4).view()));
  TestImage<Rgb8> colour(4, 4);
  const Result<Done> done = read_colour(dir / "depth.png", colour.view());
  ASSERT_FALSE(done);
  EXPECT_TRUE(contains(done.error(), "is this the depth image?")) << done.error();
}

TEST(ImageFile, MissingEmptyForeignAndHugeFilesAreErrors) {
  const TempDir dir;
  TestImage<uint16_t> depth(4, 4);
  TestImage<Rgb8> colour(4, 4);
  const Result<Done> missing = read_png16(dir / "none.png", depth.view());
  ASSERT_FALSE(missing);
  EXPECT_TRUE(contains(missing.error(), "none.png: cannot be read: No such file")) << missing.error();
  EXPECT_FALSE(read_colour(dir.path(), colour.view()));
  test::write_text(dir / "empty.png", "");
  EXPECT_FALSE(read_colour(dir / "empty.png", colour.view()));
  test::write_text(dir / "text.png", "hello");
  const Result<Done> text = read_colour(dir / "text.png", colour.view());
  ASSERT_FALSE(text);
  EXPECT_TRUE(contains(text.error(), "neither a PNG nor a JPEG")) << text.error();
  std::filesystem::resize_file(dir / "text.png", kMaxImageBytes + 1);  // sparse
  const Result<Done> large = read_colour(dir / "text.png", colour.view());
  ASSERT_FALSE(large);
  EXPECT_TRUE(contains(large.error(), "at most 67108864")) << large.error();
  test::write_text(dir / "wide.png",
                   png_bytes(8193, 1, 8, SPNG_COLOR_TYPE_GRAYSCALE, std::vector<uint8_t>(8193)));
  EXPECT_FALSE(image_info(dir / "wide.png"));
}

/// A whole file is read; one that is cut anywhere is an error. The last four bytes, the checksum of the end
/// mark of a PNG, are not looked at.
TEST(ImageFile, FilesCutAnywhereAreErrors) {
  const TempDir dir;
  ASSERT_TRUE(write_png16(dir / "depth.png", test::depth_pattern(24, 32).view()));
  ASSERT_TRUE(write_png(dir / "colour.png", test::colour_pattern(24, 32).view()));
  const std::string depth_bytes = test::read_text(dir / "depth.png");
  const std::string colour_bytes = test::read_text(dir / "colour.png");
  const std::string photo_bytes = jpeg_bytes(test::colour_pattern(24, 32));
  TestImage<uint16_t> depth(24, 32);
  TestImage<Rgb8> colour(24, 32);
  const auto cut_and_read = [&](const std::string& bytes, auto read) {
    for (size_t length = 0; length + 4 < bytes.size(); length += length < 100 ? 1 : 7) {
      test::write_text(dir / "cut", bytes.substr(0, length));
      EXPECT_FALSE(read(dir / "cut")) << "cut after " << length << " of " << bytes.size() << " bytes";
    }
    test::write_text(dir / "cut", bytes);
    EXPECT_TRUE(read(dir / "cut"));
  };
  cut_and_read(depth_bytes,
               [&](const std::string& path) { return static_cast<bool>(read_png16(path, depth.view())); });
  const auto read_any_colour = [&](const std::string& path) {
    return static_cast<bool>(read_colour(path, colour.view()));
  };
  cut_and_read(colour_bytes, read_any_colour);
  cut_and_read(photo_bytes, read_any_colour);
}

/// Outside bytes: an image or an error, never a crash.
TEST(ImageFile, MutatedFilesNeverCrash) {
  constexpr uint32_t kSeed = 7;
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  std::mt19937 random(kSeed);
  const TempDir dir;
  ASSERT_TRUE(write_png16(dir / "depth.png", test::depth_pattern(24, 32).view()));
  const std::string seeds[] = {
      test::read_text(dir / "depth.png"), jpeg_bytes(test::colour_pattern(24, 32)),
      png_bytes(32, 24, 8, SPNG_COLOR_TYPE_INDEXED, std::vector<uint8_t>(32 * 24, 1))};
  TestImage<uint16_t> depth(24, 32);
  TestImage<Rgb8> colour(24, 32);
  int refused = 0;
  for (int round = 0; round < 1500; ++round) {
    std::string bytes = seeds[round % 3];
    for (size_t change = 0, changes = 1 + random() % 4; change < changes; ++change)
      bytes[random() % bytes.size()] = static_cast<char>(random());
    test::write_text(dir / "mutated", bytes);
    const Result<Done> as_depth = read_png16(dir / "mutated", depth.view());
    const Result<Done> as_colour = read_colour(dir / "mutated", colour.view());
    refused += !as_depth && !as_colour;
  }
  EXPECT_GT(refused, 500);
}

TEST(ImageFile, FailedWritesNameFileAndReasonAndLeaveNothing) {
  const TempDir dir;
  const TestImage<Rgb8> image(4, 4);
  const Result<Done> no_folder = write_png(dir.path() + "/none/colour.png", image.view());
  ASSERT_FALSE(no_folder);
  EXPECT_TRUE(contains(no_folder.error(), "colour.png: cannot be written: No such file"))
      << no_folder.error();

  std::filesystem::create_directory(dir / "folder.png");
  EXPECT_FALSE(write_png(dir / "folder.png", image.view()));
  EXPECT_FALSE(std::filesystem::exists(dir / "folder.png.part"));

  EXPECT_FALSE(write_png(dir / "nothing.png", ImageView<const Rgb8>{}));
}

TEST(ImageFile, FullDiskKeepsTheOldFile) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "this system has no /dev/full";
  const TempDir dir;
  const std::string path = dir / "colour.png";
  ASSERT_TRUE(write_png(path, test::colour_pattern(4, 4).view()));
  const std::string before = test::read_text(path);
  std::filesystem::create_symlink("/dev/full", path + ".part");
  const Result<Done> full = write_png(path, test::colour_pattern(4, 4, 2).view());
  ASSERT_FALSE(full);
  EXPECT_TRUE(contains(full.error(), "colour.png: cannot be written: No space left")) << full.error();
  EXPECT_EQ(test::read_text(path), before);
}

TEST(ImageFile, FolderWithoutPermissionIsAnError) {
  if (::geteuid() == 0) GTEST_SKIP() << "permissions do not stop root";
  const TempDir dir;
  std::filesystem::permissions(dir.path(),
                               std::filesystem::perms::owner_read | std::filesystem::perms::owner_exec);
  const Result<Done> refused = write_png(dir.path() + "/colour.png", TestImage<Rgb8>(4, 4).view());
  std::filesystem::permissions(dir.path(), std::filesystem::perms::owner_all);
  ASSERT_FALSE(refused);
  EXPECT_TRUE(contains(refused.error(), "Permission denied")) << refused.error();
}

}  // namespace
}  // namespace stillmap
