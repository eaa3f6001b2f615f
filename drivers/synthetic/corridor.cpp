// A long corridor, furnished by throws of dice that are the same each time: nothing repeats at an even
// distance, and no two stretches look alike.

#include <algorithm>
#include <iterator>

#include "drivers/synthetic/builders.hpp"
#include "drivers/synthetic/materials.hpp"
#include "drivers/synthetic/texture.hpp"

namespace stillmap::synthetic {

namespace {

constexpr float kHalfLengthM = 33.0f;
constexpr float kHalfWidthM = 1.2f;  // between the panels, behind which are the niches
constexpr float kNicheM = 0.45f;
constexpr float kHeightM = 2.6f;
constexpr float kLampSpacingM = 5.5f;

/// One throw in an expression, or throws in braces: the order of a call's arguments is the compiler's.
class Dice {
 public:
  explicit Dice(uint32_t first_throw) : throw_(first_throw) {}

  uint32_t bits() { return mix_bits(++throw_); }
  uint32_t below(uint32_t count) { return bits() % count; }
  float between(float low, float high) { return low + (high - low) * unit(bits()); }
  Vec3 colour() { return cell_colour(bits()); }

 private:
  uint32_t throw_;
};

struct Range {
  float from, to;
};

/// One side of the corridor; `out` is metres from its wall towards the middle, negative in a niche.
struct Side {
  World& world;
  Dice& dice;
  float sign;  ///< of y

  Vec3 at(float x, float out, float z) const { return {x, sign * (kHalfWidthM - out), z}; }
  void add(const Shape& shape) const { world.shapes.push_back(shape); }
  void block(Range x, Range out, Range z, const Material& material) const {
    const Vec3 a = at(x.from, out.from, z.from), b = at(x.to, out.to, z.to);
    add(make_block({a.x, std::min(a.y, b.y), a.z}, {b.x, std::max(a.y, b.y), b.z}, material));
  }
};

struct Piece {
  float length_m, height_m;
};

const Material kMetal = {Pattern::paint, {120, 122, 128}, {84, 86, 92}, 0.05f, 0};
const Material kEnamel = {Pattern::paint, {232, 230, 222}, {190, 188, 180}, 0.12f, 2};

// ---- materials by throw

Material any_print(Dice& dice) {
  const float tile_m = dice.between(0.05f, 0.12f);
  const Vec3 ground = dice.colour();
  return print(ground, tile_m, dice.below(200));
}

Material any_cloth(Dice& dice) {
  const Vec3 dark = dice.colour();
  const float scale_m = dice.between(0.05f, 0.10f);
  return {Pattern::cloud, 0.7f * dark, blend(dark, {240, 236, 224}, 0.6f), scale_m, dice.below(200)};
}

Material any_lacquer(Dice& dice) {
  const uint32_t kind = dice.below(4), variant = dice.below(200);
  if (kind < 2) return wood(variant);
  const Vec3 colour = dice.colour();
  if (kind == 2)
    return {Pattern::cloud, 0.65f * colour, blend(colour, {235, 230, 220}, 0.5f), 0.14f, variant};
  return {Pattern::checks, 0.7f * colour, blend(colour, {235, 230, 220}, 0.4f), 0.16f, variant};
}

Material any_stripes(Dice& dice) {
  const Vec3 colour = dice.colour();
  const float scale_m = dice.between(0.05f, 0.09f);
  return {Pattern::stripes, 0.6f * colour, blend(colour, {240, 236, 224}, 0.6f), scale_m, dice.below(200)};
}

Material any_wall(Dice& dice) {
  const uint32_t kind = dice.below(3), variant = dice.below(200);
  if (kind == 0) return wallpaper(variant);
  const Vec3 colour = blend(dice.colour(), {215, 210, 196}, 0.5f);
  if (kind == 1) return {Pattern::wallpaper, colour, 0.62f * colour, 0.20f, variant};
  return {Pattern::cloud, colour, 0.66f * colour, 0.16f, variant};
}

Material any_floor(Dice& dice) {
  const uint32_t kind = dice.below(7), variant = dice.below(200);
  const Vec3 colour = blend(dice.colour(), {150, 140, 124}, 0.5f);
  const Vec3 dark = 0.5f * colour, light = blend(colour, {230, 226, 214}, 0.5f);
  if (kind == 0) return print(colour, 0.24f, variant);
  if (kind < 4) return {Pattern::checks, dark, light, kind == 1 ? 0.21f : 0.32f, variant};
  return {Pattern::cloud, dark, light, kind == 4 ? 0.16f : 0.09f, variant};
}

// ---- pieces of furniture: each begins at `x` and stands no more than 0.5 m out

/// Boxes, vases and books.
void things_on(const Side& side, Range x, float depth_m, float z) {
  Dice& dice = side.dice;
  float at_x = x.from + dice.between(0.10f, 0.20f);
  while (at_x < x.to - 0.12f) {
    const float height_m = dice.between(0.08f, 0.22f), out = depth_m * dice.between(0.4f, 0.6f);
    const Vec3 centre = side.at(at_x, out, z + height_m);
    const uint32_t kind = dice.below(3);
    if (kind == 0) side.add(make_ellipsoid(centre, {0.08f, 0.08f, height_m}, any_stripes(dice)));
    if (kind == 1) {
      const float yaw = dice.between(-0.5f, 0.5f);
      side.add(make_box(centre, {0.11f, 0.08f, height_m}, any_print(dice), yaw));
    }
    if (kind == 2) {
      const Material spines = {Pattern::spines, dice.colour(), {225, 215, 190}, 0.035f, dice.below(200)};
      side.add(make_box(centre, {0.13f, 0.09f, height_m}, spines));
    }
    at_x += dice.between(0.30f, 0.55f);
  }
}

Piece cabinet(const Side& side, float x) {
  Dice& dice = side.dice;
  const float length = dice.between(0.75f, 1.25f), depth = dice.between(0.30f, 0.42f);
  const float top = dice.between(0.62f, 1.0f), middle = x + length * dice.between(0.35f, 0.65f);
  side.block({x, x + length}, {-0.05f, depth}, {0.06f, top}, any_lacquer(dice));
  side.block({x - 0.03f, x + length + 0.03f}, {-0.05f, depth + 0.03f}, {top, top + 0.03f},
             wood(dice.below(200)));
  side.block({middle - 0.012f, middle + 0.012f}, {depth, depth + 0.012f}, {0.1f, top - 0.04f}, kMetal);
  for (const float knob : {middle - 0.06f, middle + 0.06f})
    side.add(make_ellipsoid(side.at(knob, depth + 0.01f, 0.65f * top), {0.02f, 0.03f, 0.02f}, kMetal));
  things_on(side, {x, x + length}, depth, top + 0.03f);
  return {length, top + 0.4f};
}

Piece locker(const Side& side, float x) {
  Dice& dice = side.dice;
  const float door = dice.between(0.32f, 0.42f), depth = dice.between(0.32f, 0.48f);
  const float top = dice.between(1.6f, 2.05f);
  const uint32_t doors = 1 + dice.below(3);
  const float length = door * static_cast<float>(doors);
  side.block({x, x + length}, {-0.05f, depth - 0.015f}, {0.0f, top}, kMetal);
  for (uint32_t i = 0; i < doors; ++i) {
    const float from = x + door * static_cast<float>(i) + 0.012f, to = from + door - 0.024f;
    side.block({from, to}, {0.0f, depth}, {0.08f, top - 0.04f}, any_lacquer(dice));
    side.block({to - 0.06f, to - 0.04f}, {depth, depth + 0.025f}, {0.95f, 1.10f}, kMetal);
    side.block({from + 0.06f, to - 0.09f}, {depth, depth + 0.004f}, {1.25f, 1.40f}, any_print(dice));
  }
  side.add(
      make_box(side.at(x + 0.5f * length, 0.2f, top + 0.10f), {0.14f, 0.12f, 0.10f}, any_print(dice), 0.3f));
  return {length, 2.4f};
}

Piece bench(const Side& side, float x) {
  Dice& dice = side.dice;
  const float length = dice.between(1.0f, 1.5f), depth = dice.between(0.36f, 0.46f);
  const Material seat = wood(dice.below(200));
  side.block({x, x + length}, {0.02f, depth}, {0.41f, 0.46f}, seat);
  side.block({x, x + length}, {0.02f, 0.06f}, {0.60f, 0.86f}, seat);
  for (const float leg : {x + 0.08f, x + length - 0.08f})
    for (const float out : {0.06f, depth - 0.05f})
      side.add(make_capsule(side.at(leg, out, 0.0f), side.at(leg, out, 0.41f), 0.022f, kMetal));
  const float cushion = x + dice.between(0.22f, length - 0.55f);
  side.add(make_ellipsoid(side.at(cushion, 0.16f, 0.62f), {0.19f, 0.10f, 0.17f}, any_cloth(dice)));
  const float bag = cushion + 0.36f, yaw = dice.between(-0.4f, 0.4f);
  side.add(make_box(side.at(bag, 0.24f, 0.57f), {0.13f, 0.09f, 0.11f}, any_print(dice), yaw));
  return {length, 0.95f};
}

Piece radiator(const Side& side, float x) {
  Dice& dice = side.dice;
  const uint32_t ribs = 5 + dice.below(5);
  const float rib = 0.12f, length = rib * static_cast<float>(ribs), top = dice.between(0.65f, 0.85f);
  for (uint32_t i = 0; i < ribs; ++i) {
    const float from = x + rib * static_cast<float>(i);
    side.block({from, from + 0.08f}, {0.06f, 0.19f}, {0.12f, top}, kEnamel);
  }
  side.block({x - 0.06f, x + length + 0.02f}, {-0.05f, 0.27f}, {top + 0.10f, top + 0.14f},
             wood(dice.below(200)));
  things_on(side, {x, x + length}, 0.24f, top + 0.14f);
  return {length, top + 0.55f};
}

Piece cartons(const Side& side, float x) {
  Dice& dice = side.dice;
  float z = 0.0f;
  const uint32_t storeys = 1 + dice.below(3);
  for (uint32_t i = 0; i < storeys; ++i) {
    const Vec3 half = {dice.between(0.17f, 0.28f), dice.between(0.13f, 0.18f), dice.between(0.12f, 0.2f)};
    const float yaw = dice.between(-0.3f, 0.3f), out = dice.between(0.23f, 0.27f);
    side.add(make_box(side.at(x + 0.3f, out, z + half.z), half, any_print(dice), yaw));
    z += 2.0f * half.z;
  }
  const float ball_m = dice.between(0.08f, 0.13f);
  side.add(make_ellipsoid(side.at(x + 0.72f, 0.2f, ball_m), {ball_m, ball_m, ball_m}, any_cloth(dice)));
  return {0.8f, z + 0.1f};
}

Piece plant(const Side& side, float x) {
  Dice& dice = side.dice;
  const float middle = x + 0.26f, top = dice.between(0.8f, 1.6f);
  side.add(
      make_capsule(side.at(middle, 0.24f, 0.10f), side.at(middle, 0.24f, 0.30f), 0.15f, any_stripes(dice)));
  side.add(make_capsule(side.at(middle, 0.24f, 0.4f), side.at(middle, 0.22f, top), 0.02f, wood(3)));
  const Material leaves = {Pattern::cloud, {26, 66, 30}, {130, 178, 84}, 0.05f, dice.below(200)};
  const uint32_t bushels = 3 + dice.below(3);
  for (uint32_t i = 0; i < bushels; ++i) {
    const Vec3 half = {dice.between(0.10f, 0.22f), dice.between(0.10f, 0.18f), dice.between(0.08f, 0.15f)};
    const float beside = dice.between(-0.12f, 0.12f), out = dice.between(0.2f, 0.3f);
    const float z = top - 0.17f * static_cast<float>(i), yaw = dice.between(-0.6f, 0.6f);
    side.add(make_ellipsoid(side.at(middle + beside, out, z), half, leaves, yaw));
  }
  return {0.52f, top + 0.25f};
}

Piece bookshelf(const Side& side, float x) {
  Dice& dice = side.dice;
  const float length = dice.between(0.8f, 1.2f), depth = dice.between(0.26f, 0.34f), storey = 0.37f;
  const uint32_t boards = 3 + dice.below(4), variant = dice.below(200);
  const float top = 0.06f + storey * static_cast<float>(boards - 1);
  const Material frame = wood(variant);
  for (const float end : {x, x + length - 0.025f})
    side.block({end, end + 0.025f}, {0.0f, depth}, {0.0f, top + 0.03f}, frame);
  for (uint32_t i = 0; i < boards; ++i) {
    const float z = 0.06f + storey * static_cast<float>(i);
    side.block({x, x + length}, {0.0f, depth}, {z - 0.02f, z + 0.01f}, frame);
    if (i + 1 == boards) break;
    const float from = x + dice.between(0.03f, 0.25f), to = x + length - dice.between(0.03f, 0.40f);
    const float height_m = dice.between(0.20f, 0.31f), back_m = dice.between(0.02f, 0.10f);
    const Material spines = {Pattern::spines, dice.colour(), {225, 215, 190}, 0.035f, dice.below(200)};
    side.block({from, to}, {0.02f, depth - back_m}, {z + 0.01f, z + height_m}, spines);
  }
  return {length, top + 0.15f};
}

Piece chair(const Side& side, float x) {
  Dice& dice = side.dice;
  const float middle = x + 0.26f, yaw = dice.between(-0.35f, 0.35f);
  const Material seat = any_cloth(dice);
  const Vec3 centre = side.at(middle, 0.26f, 0.45f);
  const Mat3 turned = yaw_rotation(yaw);
  side.add(make_box(centre, {0.20f, 0.19f, 0.035f}, seat, yaw));
  side.add(make_box(centre + turned * Vec3{0, 0.17f * side.sign, 0.31f}, {0.19f, 0.025f, 0.20f}, seat, yaw));
  for (const float dx : {-0.17f, 0.17f})
    for (const float dy : {-0.16f, 0.16f}) {
      const Vec3 leg = centre + turned * Vec3{dx, dy, -0.03f};
      side.add(make_capsule({leg.x, leg.y, 0.0f}, leg, 0.02f, wood(7)));
    }
  return {0.52f, 1.05f};
}

Piece coats(const Side& side, float x) {
  Dice& dice = side.dice;
  const uint32_t hooks = 2 + dice.below(3);
  const float length = 0.30f * static_cast<float>(hooks);
  side.block({x, x + length}, {0.0f, 0.09f}, {1.68f, 1.78f}, wood(dice.below(200)));
  for (uint32_t i = 0; i < hooks; ++i) {
    const float middle = x + 0.15f + 0.30f * static_cast<float>(i), low = dice.between(0.75f, 1.1f);
    const float thick_m = dice.between(0.09f, 0.13f);
    side.add(
        make_capsule(side.at(middle, 0.14f, low), side.at(middle, 0.13f, 1.52f), thick_m, any_cloth(dice)));
  }
  side.block({x, x + length}, {0.05f, 0.32f}, {0.16f, 0.20f}, wood(5));
  things_on(side, {x, x + length}, 0.28f, 0.20f);
  return {length, 2.4f};
}

Piece table(const Side& side, float x) {
  Dice& dice = side.dice;
  const float length = dice.between(0.7f, 1.1f), depth = dice.between(0.36f, 0.48f);
  const float top = dice.between(0.68f, 0.9f);
  side.block({x, x + length}, {0.0f, depth}, {top - 0.04f, top}, any_lacquer(dice));
  for (const float leg : {x + 0.05f, x + length - 0.05f})
    for (const float out : {0.05f, depth - 0.05f})
      side.add(make_capsule(side.at(leg, out, 0.0f), side.at(leg, out, top - 0.05f), 0.025f, wood(9)));
  things_on(side, {x, x + length}, depth, top);
  const float under_m = dice.between(0.14f, 0.20f), yaw = dice.between(-0.4f, 0.4f);
  side.add(
      make_box(side.at(x + 0.5f * length, 0.22f, under_m), {0.18f, 0.13f, under_m}, any_print(dice), yaw));
  return {length, top + 0.45f};
}

constexpr Piece (*kPieces[])(const Side&, float) = {cabinet, locker,    bench, radiator, cartons,
                                                    plant,   bookshelf, chair, coats,    table};

// ---- walls

void picture(const Side& side, Range x, Range z) {
  Dice& dice = side.dice;
  const float thick_m = dice.between(0.10f, 0.13f);
  const Material frame = wood(dice.below(200));
  side.block({x.from, x.to}, {0.0f, thick_m - 0.012f}, z, frame);
  side.block({x.from + 0.04f, x.to - 0.04f}, {0.0f, thick_m}, {z.from + 0.04f, z.to - 0.04f},
             any_print(dice));
}

/// A board with sheets of paper, some of which stand off.
void notice_board(const Side& side, Range x, Range z) {
  Dice& dice = side.dice;
  side.block(x, {0.0f, 0.10f}, z, {Pattern::cloud, {120, 84, 52}, {196, 150, 104}, 0.04f, dice.below(200)});
  for (float from = x.from + 0.05f; from < x.to - 0.25f; from += 0.27f) {
    const float low = z.from + dice.between(0.05f, 0.3f * (z.to - z.from));
    const float high = z.to - dice.between(0.05f, 0.3f * (z.to - z.from)), out = dice.between(0.104f, 0.13f);
    side.block({from, from + 0.21f}, {0.09f, out}, {low, high}, any_print(dice));
  }
}

void wall_board(const Side& side, Range x, Range z) {
  const float depth = side.dice.between(0.22f, 0.30f);
  side.block(x, {0.0f, depth}, {z.from, z.from + 0.03f}, wood(side.dice.below(200)));
  things_on(side, x, depth, z.from + 0.03f);
}

/// What hangs over a piece of furniture, if there is room.
void hang_above(const Side& side, Range x, float from_z) {
  Dice& dice = side.dice;
  const float low = std::max(from_z, dice.between(1.05f, 1.35f)), high = dice.between(1.85f, 2.25f);
  const float from = x.from + dice.between(0.08f, 0.20f), to = x.to - dice.between(0.08f, 0.20f);
  if (high - low < 0.3f || to - from < 0.3f) return;
  const uint32_t kind = dice.below(4);
  if (kind == 0) notice_board(side, {from, to}, {low, high});
  if (kind == 1) wall_board(side, {from, to}, {low, high});
  if (kind < 2) return;
  const float middle = from + (to - from) * dice.between(0.35f, 0.65f);
  picture(side, {from, middle - 0.04f}, {low, high - dice.between(0.0f, 0.15f)});
  picture(side, {middle + 0.04f, to}, {low + dice.between(0.0f, 0.15f), high});
}

void panel(const Side& side, Range x) {
  const float out = side.dice.between(0.0f, 0.08f);
  side.block(x, {-kNicheM - 0.05f, out}, {0.0f, kHeightM}, any_wall(side.dice));
}

/// A stretch of wall with a piece of furniture before it.
/// @return where it ends
float bay(const Side& side, float x, Piece (*make)(const Side&, float)) {
  const float before_m = side.dice.between(0.10f, 0.40f), after_m = side.dice.between(0.10f, 0.40f);
  const Piece piece = make(side, x + before_m);
  const float end = x + before_m + piece.length_m + after_m;
  panel(side, {x, end});
  hang_above(side, {x, end}, piece.height_m);
  return end;
}

float door_niche(const Side& side, float x) {
  Dice& dice = side.dice;
  const float width = dice.between(0.85f, 1.0f), deep_m = dice.between(0.10f, 0.40f), top = 2.05f;
  const Range inner = {x + 0.08f, x + width - 0.08f};
  const Material frame = dice.below(2) == 0 ? kEnamel : wood(dice.below(200));
  side.block(inner, {-kNicheM - 0.05f, -deep_m}, {0.0f, top}, any_lacquer(dice));
  side.block({x, inner.from}, {-kNicheM - 0.05f, 0.10f}, {0.0f, top + 0.08f}, frame);
  side.block({inner.to, x + width}, {-kNicheM - 0.05f, 0.10f}, {0.0f, top + 0.08f}, frame);
  side.block(inner, {-kNicheM - 0.05f, 0.10f}, {top, top + 0.08f}, frame);
  side.block({x, x + width}, {-kNicheM - 0.05f, 0.03f}, {top + 0.08f, kHeightM}, any_wall(dice));
  side.add(make_ellipsoid(side.at(inner.to - 0.08f, -deep_m + 0.05f, 1.02f), {0.05f, 0.03f, 0.02f}, kMetal));
  const float low = dice.between(1.2f, 1.4f);
  side.block({inner.from + 0.2f, inner.to - 0.2f}, {-deep_m - 0.02f, -deep_m + 0.015f}, {low, 1.75f},
             any_print(dice));
  return x + width;
}

/// Shelves or a lone thing in the depth of the wall.
float alcove(const Side& side, float x) {
  Dice& dice = side.dice;
  const float width = dice.between(0.7f, 1.2f), top = dice.between(2.0f, 2.2f);
  const Range in = {-kNicheM, -0.02f};
  side.block({x, x + width}, {-kNicheM - 0.05f, 0.02f}, {top, kHeightM}, any_wall(dice));
  side.block({x, x + width}, {-kNicheM - 0.05f, -kNicheM + 0.02f}, {0.0f, 2.2f}, any_print(dice));
  const uint32_t boards = dice.below(3);
  for (uint32_t i = 0; i < boards; ++i) {
    const float z = 0.75f + 0.45f * static_cast<float>(i);
    side.block({x, x + width}, in, {z, z + 0.03f}, wood(dice.below(200)));
    things_on(side, {x, x + width}, -0.4f, z + 0.03f);
  }
  const float height_m = dice.between(0.2f, 0.33f), yaw = dice.between(-0.3f, 0.3f);
  side.add(
      make_box(side.at(x + 0.5f * width, -0.18f, height_m), {0.24f, 0.15f, height_m}, any_cloth(dice), yaw));
  return x + width;
}

float pillar(const Side& side, float x) {
  Dice& dice = side.dice;
  const float width = dice.between(0.25f, 0.45f), out = dice.between(0.14f, 0.30f);
  side.block({x, x + width}, {-kNicheM - 0.05f, out}, {0.0f, kHeightM}, any_wall(dice));
  const float low = dice.between(0.9f, 1.3f);
  side.block({x + 0.05f, x + width - 0.05f}, {0.0f, out + 0.02f}, {low, low + 0.35f}, any_print(dice));
  return x + width;
}

/// @return where it ends; often nothing is between two bays
float between_bays(const Side& side, float x) {
  switch (side.dice.below(6)) {
    case 0:
    case 1:
      return door_niche(side, x);
    case 2:
      return alcove(side, x);
    case 3:
    case 4:
      return pillar(side, x);
    default:
      return x;
  }
}

void furnish_side(const Side& side) {
  constexpr auto kKinds = static_cast<uint32_t>(std::size(kPieces));
  constexpr float kLongestM = 2.4f + 1.2f;  // a bay and what follows it
  uint32_t kind = side.dice.below(kKinds);
  float x = -kHalfLengthM;
  while (kHalfLengthM - x > kLongestM) {
    x = between_bays(side, bay(side, x, kPieces[kind]));
    kind = (kind + 1 + side.dice.below(kKinds - 1)) % kKinds;  // never the same twice in a row
  }
  x = bay(side, x, bookshelf);
  panel(side, {x, kHalfLengthM});
  cartons(side, x);
}

// ---- ends, floor, ceiling

void furnish_end(World& world, Dice& dice, float sign) {
  const auto block = [&](float out, Range y, Range z, const Material& material) {
    const float a = sign * kHalfLengthM, b = sign * (kHalfLengthM - out);
    world.shapes.push_back(
        make_block({std::min(a, b), y.from, z.from}, {std::max(a, b), y.to, z.to}, material));
  };
  const float low_top = dice.between(0.55f, 0.57f), high_top = dice.between(1.2f, 1.5f);
  block(0.40f, {-0.75f, 0.20f}, {0.0f, low_top}, any_lacquer(dice));
  block(0.22f, {0.30f, 0.80f}, {0.0f, high_top}, any_lacquer(dice));
  block(0.03f, {-0.70f, 0.15f}, {1.0f, 1.9f}, any_print(dice));
  block(0.06f, {0.30f, 0.90f}, {1.6f, 2.2f}, any_print(dice));
  const Vec3 vase = {sign * (kHalfLengthM - 0.2f), -0.3f, 0.85f};
  world.shapes.push_back(make_ellipsoid(vase, {0.11f, 0.11f, 0.28f}, any_stripes(dice)));
}

/// The floor changes every few metres; mats lie on it.
void lay_floor(World& world, Dice& dice) {
  float x = -kHalfLengthM;
  for (uint32_t i = 0; x < kHalfLengthM; ++i) {
    const float end = std::min(kHalfLengthM, x + dice.between(1.8f, 4.2f));
    const float thick_m = i % 2 == 0 ? 0.004f : 0.007f, edge = kHalfWidthM + kNicheM;
    world.shapes.push_back(make_block({x, -edge, 0.0f}, {end, edge, thick_m}, any_floor(dice)));
    const float mat_x = x + dice.between(0.5f, 0.9f) * (end - x), mat_y = dice.between(-0.3f, 0.3f);
    const float yaw = dice.between(-0.25f, 0.25f);
    const Material mat = dice.below(2) == 0 ? any_stripes(dice) : any_print(dice);
    world.shapes.push_back(make_box({mat_x, mat_y, 0.007f}, {0.45f, 0.32f, 0.008f}, mat, yaw));
    x = end;
  }
}

/// Lamps where the renderer has its light, beams across with a sign on each face.
void hang_from_ceiling(World& world, Dice& dice) {
  constexpr float kFirstLampX = 0.2f, kLampY = 0.1f;
  for (int i = -5; i <= 5; ++i)
    world.shapes.push_back(
        make_ellipsoid({kFirstLampX + kLampSpacingM * static_cast<float>(i), kLampY, 2.48f},
                       {0.24f, 0.24f, 0.10f}, {Pattern::plain, {250, 246, 226}, {}, 0.1f, 0}));
  for (const float x : {-24.1f, -15.8f, -5.3f, 2.9f, 13.6f, 22.7f}) {
    const float low = dice.between(2.1f, 2.3f), half_m = dice.between(0.10f, 0.18f);
    world.shapes.push_back(
        make_block({x - half_m, -kHalfWidthM, low}, {x + half_m, kHalfWidthM, kHeightM}, any_wall(dice)));
    const float left = dice.between(-0.7f, 0.0f), sign_m = half_m + 0.02f;
    world.shapes.push_back(
        make_block({x - sign_m, left, low - 0.08f}, {x + sign_m, left + 0.7f, low + 0.2f}, any_print(dice)));
  }
}

}  // namespace

void corridor(World& world) {
  world.room = {{Pattern::cloud, {112, 100, 84}, {190, 176, 150}, 0.14f, 0},
                {Pattern::cloud, {226, 226, 222}, {186, 188, 194}, 0.3f, 4}};
  world.lamp_spacing_m = kLampSpacingM;
  const Vec3 half_m = {kHalfLengthM, kHalfWidthM + kNicheM, 0.5f * kHeightM};
  world.shapes.push_back({Kind::room, false, half_m, {Mat3{}, {0, 0, half_m.z}}, wallpaper(0)});
  Dice dice(1000);
  for (const float sign : {-1.0f, 1.0f}) furnish_side({world, dice, sign});
  for (const float sign : {-1.0f, 1.0f}) furnish_end(world, dice, sign);
  lay_floor(world, dice);
  hang_from_ceiling(world, dice);
}

}  // namespace stillmap::synthetic
