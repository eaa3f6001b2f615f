// The scenes, after the Bonn RGB-D Dynamic Dataset. The camera is most often in the west of the room and
// looks east (+x); people come from beside it. Where somebody is near, the numbers keep 0.6 m to the lens.

#include <algorithm>
#include <array>
#include <iterator>

#include "drivers/synthetic/motion.hpp"

namespace stillmap::synthetic {

namespace {

constexpr Spot2 kToCamera = {-0.25, 0.0};
constexpr Spot2 kNorthWing = {-0.80, 0.98};  // out of view beside the camera
constexpr Spot2 kSouthWing = {-0.85, -1.10};
constexpr Spot2 kSouthCorner = {-1.25, -1.40};
constexpr Spot2 kWideSouthWing = {-0.60, -1.18};  // for who carries something

const Material kCarton = {Pattern::poster, {176, 134, 90}, {210, 180, 140}, 0.11f, 21};
const Material kBigCarton = {Pattern::cloud, {176, 136, 92}, {224, 186, 136}, 0.09f, 22};

Vec3 to_float(double x, double y, double z) {
  return {static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
}

void add_box(World& world, Vec3 centre, Vec3 half, float yaw, const Material& material, bool moving) {
  world.shapes.push_back(make_box(centre, half, material, yaw));
  world.shapes.back().moving = moving;
}

/// A box that is carried until `down_s` and stands where it is from then on.
void add_carried_box(World& world, Vec3 centre, Vec3 half, float yaw, const Material& material, double t,
                     double down_s) {
  constexpr double kJustNowS = 1.0;
  add_box(world, centre, half, yaw, material, t < down_s);
  world.shapes.back().put_down = t >= down_s && t < down_s + kJustNowS;
}

/// The hands at the two sides of a box whose width is along its local y.
void hold(Stance& person, Vec3 centre, Vec3 half, float box_yaw, float height_m, double grip = 1.0) {
  const Vec3 side = yaw_rotation(box_yaw) * Vec3{0, half.y + 0.03f, 0};
  const Vec3 at = centre + Vec3{0, 0, height_m};
  const Vec3 left = {-std::sin(person.yaw), std::cos(person.yaw), 0};
  const bool same_side = dot(left, side) > 0.0f;
  person.grip = static_cast<float>(grip);
  person.left_hand_m = same_side ? at + side : at - side;
  person.right_hand_m = same_side ? at - side : at + side;
}

void no_movers(double, World&) {}

// ---- static, loop, fast

Se3d static_camera(double t) {
  static const Sway sway = {{-1.30, 0.0, 1.35}, {0.20, 0.45, 0.10}, {6.7, 5.2, 4.4}, 0, 14, 6.1, -7, 5, 4.7};
  return sway_camera(sway, t);
}

Se3d loop_camera(double t) {
  // One turn in 19 s: the last second sees again what the first one saw.
  const double turn = from_rest(t) / 19.0;
  const double angle = kTurn * turn;
  const Vec3d place = {0.05 + 0.62 * std::cos(angle), -0.08 + 0.50 * std::sin(angle),
                       1.32 + 0.08 * std::sin(3 * angle)};
  return handheld(place, angle, kDegree * (-8.0 + 5.0 * std::sin(2 * angle)), t);
}

Se3d fast_camera(double t) {
  static const Sway sway = {{-0.75, 0.0, 1.38}, {0.16, 0.35, 0.07}, {6.7, 5.2, 4.4}, 0, 6, 6.1, -7, 5, 4.7};
  // Swings of up to 100 degrees in a second, about 6 degrees a frame in their middle.
  const double swing = 50.0 * rise(1.5, 2.3, t) - 100.0 * rise(2.9, 3.9, t) + 100.0 * rise(4.9, 5.85, t) -
                       50.0 * rise(6.6, 7.3, t) + 45.0 * rise(7.9, 8.6, t) - 45.0 * rise(9.0, 9.7, t);
  return handheld(sway_place(sway, t), sway_yaw(sway, t) + kDegree * swing, sway_pitch(sway, t), t);
}

// ---- long_loop

constexpr double kRound_s = 54.0;  // of walking, then the camera stands where it began

/// Once round the suite, against the clock, through its eight doors.
constexpr Spot2 kRound[] = {
    {-2.6, -2.00}, {-1.3, -1.65}, {0.0, -1.45}, {1.3, -1.70}, {2.6, -2.10},  {3.8, -2.35},
    {5.0, -2.40},  {6.3, -2.65},  {7.6, -2.85}, {8.5, -2.30}, {8.4, -1.15},  {7.6, 0.00},
    {7.9, 1.10},   {8.3, 2.00},   {7.6, 2.75},  {6.3, 2.45},  {5.0, 1.50},   {3.8, 1.60},
    {2.6, 2.00},   {1.3, 2.40},   {0.0, 2.50},  {-1.3, 2.40}, {-2.6, 2.05},  {-3.8, 1.75},
    {-5.0, 1.70},  {-6.2, 2.40},  {-7.4, 2.75}, {-8.3, 2.10}, {-8.2, 1.00},  {-7.4, 0.00},
    {-8.1, -1.1},  {-8.2, -2.1},  {-7.4, -2.8}, {-6.2, -2.5}, {-5.0, -1.60}, {-3.8, -1.80}};

/// Every point with its time at an even pace; some of the next round follow, for whoever looks ahead, and
/// some of the last one precede, for the direction at the start.
std::vector<Waypoint> evenly_paced_round() {
  constexpr int kPoints = static_cast<int>(std::size(kRound)), kMore = 4;
  const auto point = [](int i) { return kRound[(i + kPoints) % kPoints]; };
  const auto step_m = [&](int i) {
    const Spot2 step = point(i + 1) - point(i);
    return std::hypot(step.x, step.y);
  };
  double round_m = 0;
  for (int i = 0; i < kPoints; ++i) round_m += step_m(i);
  double t = 0;
  for (int i = -kMore; i < 0; ++i) t -= step_m(i) * kRound_s / round_m;
  std::vector<Waypoint> way;
  for (int i = -kMore; i <= kPoints + kMore; ++i) {
    way.push_back({t, point(i)});
    t += step_m(i) * kRound_s / round_m;
  }
  return way;
}

Se3d long_loop_camera(double t) {
  static const std::vector<Waypoint> way = evenly_paced_round();
  const double walked_s = from_rest(t, 1.5) - from_rest(std::max(0.0, t - kRound_s), 1.5);
  const Spot2 place = along(way, walked_s), ahead = along(way, walked_s + 1.6) - place;
  const double yaw = std::atan2(ahead.y, ahead.x) + 20.0 * kDegree * wave(walked_s, kRound_s / 8.0);
  return handheld({place.x, place.y, 1.36 + 0.05 * wave(walked_s, kRound_s / 11.0)}, yaw,
                  kDegree * (-6.0 + 4.0 * wave(walked_s, kRound_s / 9.0)), t);
}

// ---- corridor

constexpr double kCorridorPace_m_per_s = 1.1;
constexpr double kOneWay_s = 56.0;  // of walking, besides a second at each end to set off and to stop
constexpr double kSetOff_s = 2.0;
constexpr double kTurning_s = 10.0;  // at most 34 degrees a second
constexpr double kSetOffBack_s = kOneWay_s + kTurning_s + 0.5;

/// Seconds of an even walk that begins at `from_s` and ends where `kOneWay_s` of it lead.
double walked_s(double from_s, double t) {
  const double since_s = std::max(0.0, t - from_s);
  return from_rest(since_s, kSetOff_s) - from_rest(std::max(0.0, since_s - kOneWay_s), kSetOff_s);
}

/// To the far end, about, back, and about again: the end is the start.
Se3d corridor_camera(double t) {
  const double there_s = walked_s(0.0, t), back_s = walked_s(kSetOffBack_s, t), both_s = there_s + back_s;
  const double about_s = kOneWay_s + 1.0, about_again_s = kSetOffBack_s + about_s;
  const double turns =
      0.5 * (rise(about_s, about_s + kTurning_s, t) + rise(about_again_s, about_again_s + kTurning_s, t));
  const double x = kCorridorPace_m_per_s * (there_s - back_s - 0.5 * kOneWay_s);
  const double y = 0.18 * wave(both_s, kOneWay_s / 9.0) + 0.05 * wave(both_s, kOneWay_s / 13.0);
  const double yaw = kTurn * turns + 7.0 * kDegree * wave(both_s, kOneWay_s / 10.0);
  const double pitch = kDegree * (-12.5 + 2.0 * wave(both_s, kOneWay_s / 12.0));
  return handheld({x, y, 1.16 + 0.02 * wave(both_s, kOneWay_s / 22.0)}, yaw, pitch, t);
}

// ---- balloon

constexpr float kBalloonM = 0.30f;

void add_balloon_and_person(World& world, const Stance& stance, Vec3 balloon) {
  Stance person = stance;
  person.grip = 1.0f;  // hands below the balloon, ready to push it up
  const Vec3 side = {-0.16f * std::sin(stance.yaw), 0.16f * std::cos(stance.yaw), 0};
  const Vec3 under = balloon - Vec3{0, 0, 0.8f * kBalloonM};
  person.left_hand_m = under + side;
  person.right_hand_m = under - side;
  add_person(world, person, 0);
  Shape ball = make_ellipsoid(balloon, {kBalloonM, kBalloonM, 1.1f * kBalloonM},
                              {Pattern::cloud, {196, 40, 50}, {226, 90, 84}, 0.25f, 5});
  ball.moving = true;
  world.shapes.push_back(ball);
}

/// 0..1, as a ball that is pushed up once in `period_s`.
double bounce(double t, double period_s) {
  const double x = t / period_s - std::floor(t / period_s);
  return 4.0 * x * (1.0 - x);
}

Se3d balloon_camera(double t) {
  static const Sway sway = {{-1.38, 0.0, 1.36}, {0.10, 0.34, 0.06}, {6.3, 4.3, 4.9}, 0, 8, 5.3, -3, 2.5, 4.7};
  return sway_camera(sway, t);
}

void balloon_movers(double t, World& world) {
  const double in = rise(0.8, 2.6, t);
  const auto path = [](double s) {
    return mixed(kSouthWing, Spot2{0.50 + 0.15 * wave(s, 5.7), 0.40 * wave(s, 6.4)}, rise(0.8, 2.6, s));
  };
  const Stance person = walk(path, t, {-0.6, 0});
  const Vec3 play =
      to_float(-0.02 + 0.10 * wave(t, 4.1), 0.48 * wave(t, 5.2, 0.1), 1.12 + 0.42 * bounce(t, 1.5));
  const Vec3 carried = before(person, 0.45f, 1.1f);
  add_balloon_and_person(world, person, carried + static_cast<float>(in) * (play - carried));
}

Vec3d tracked_balloon(double t) {
  const double in = rise(0.9, 2.6, t);
  const Vec3d start = {-0.75, -1.12, 1.25};
  const Vec3d play = {0.05 + 0.35 * wave(t, 6.2), 0.72 * wave(t, 5.4, 0.55), 1.12 + 0.40 * bounce(t, 1.7)};
  return start + in * (play - start);
}

Se3d balloon_tracking_camera(double t) {
  static const Sway sway = {{-1.36, 0.05, 1.36}, {0.12, 0.30, 0.06}, {6.3, 4.6, 4.9}, 0, 3, 5.3, -3, 2, 4.7};
  const Vec3d place = sway_place(sway, t);
  const Vec3d ahead = {0.4, 0.0, 1.30};
  const Vec3d target = tracked_balloon(t - 0.12);
  const Vec3d aim = ahead + 0.85 * rise(1.2, 3.0, t) * (target - ahead) - place;
  return handheld(place, std::atan2(aim.y, aim.x), 0.7 * std::atan2(aim.z, std::hypot(aim.x, aim.y)), t);
}

void balloon_tracking_movers(double t, World& world) {
  const auto path = [](double s) {
    const Vec3d b = tracked_balloon(s - 0.35);
    return Spot2{b.x + 0.50, 0.9 * b.y};
  };
  const Vec3d b = tracked_balloon(t);
  add_balloon_and_person(world, walk(path, t, {-0.6, 0}), cast<float>(Se3d{{}, b}).translation);
}

// ---- crowds

Se3d crowd_camera(double t) {
  static const Sway sway = {{-1.42, 0.0, 1.36}, {0.08, 0.34, 0.06}, {6.3, 4.4, 4.9}, 0, 9, 5.3, -4, 2.5, 4.7};
  return sway_camera(sway, t);
}

/// Three people who cross the view in front of each other.
Spot2 crowd_place(int who, double t) {
  switch (who) {
    case 0:
      return {0.05 + 0.12 * wave(t, 3.7), 0.62 * wave(t, 5.6, 0.10)};
    case 1:
      return {0.62 + 0.12 * wave(t, 4.3), -0.75 * wave(t, 6.6, 0.05)};
    default:
      return {1.12 + 0.10 * wave(t, 5.1), 0.70 * wave(t, 4.9, 0.62)};
  }
}

void crowd_movers(double t, World& world) {
  const Spot2 wings[3] = {kNorthWing, kSouthWing, kSouthCorner};
  const double from[3] = {0.8, 1.0, 1.8}, to[3] = {2.6, 3.2, 4.4};
  for (int who = 0; who < 3; ++who) {
    const auto path = [&](double s) {
      return mixed(wings[who], crowd_place(who, s), rise(from[who], to[who], s));
    };
    add_person(world, walk(path, t, kToCamera), static_cast<uint32_t>(who));
  }
}

/// Looks about, so that it maps new parts of the room while people stand before them.
Se3d crowd_start_camera(double t) {
  static const Sway sway = {
      {-1.34, 0.0, 1.36}, {0.08, 0.34, 0.06}, {6.3, 4.4, 4.9}, 0, 26, 7.4, -4, 2.5, 4.7};
  return sway_camera(sway, t);
}

void crowd_start_movers(double t, World& world) {
  for (int who = 0; who < 3; ++who) {
    // All stand still at first, then set off slowly one after the other.
    const auto path = [&](double s) {
      const Spot2 nearer = {who == 0 ? -0.30 : -0.45, 0.0};
      return nearer + crowd_place(who, 0.4 + 2.1 * who + from_rest(std::max(0.0, s - 0.5 * who), 4.0));
    };
    add_person(world, walk(path, t, kToCamera), static_cast<uint32_t>(3 + who));
  }
}

Se3d crowd_close_camera(double t) {
  static const Sway sway = {
      {-1.50, 0.0, 1.36}, {0.06, 0.26, 0.05}, {6.3, 4.2, 4.9}, 0, 26, 6.7, -6, 2.5, 4.7};
  return sway_camera(sway, t);
}

void crowd_close_movers(double t, World& world) {
  const Spot2 wings[3] = {{-0.85, 1.15}, {-0.9, -1.25}, {-1.4, -1.55}};
  const double from[3] = {0.8, 1.6, 1.5}, to[3] = {3.2, 4.2, 4.4};
  for (int who = 0; who < 3; ++who) {
    const auto path = [&](double s) {
      const Spot2 near_by[3] = {{-0.48 + 0.05 * wave(s, 3.9), 0.45 * wave(s, 6.1, 0.15)},
                                {-0.10 + 0.04 * wave(s, 4.4), -0.55 * wave(s, 5.2, 0.05)},
                                {0.22 + 0.04 * wave(s, 3.3), 0.60 * wave(s, 4.7, 0.4)}};
      return mixed(wings[who], near_by[who], rise(from[who], to[who], s));
    };
    add_person(world, walk(path, t, {-0.25, 0}), static_cast<uint32_t>(2 + who));
  }
}

// ---- boxes

/// A box that stands close before the camera when the scene begins, so that it is mapped. Somebody comes from
/// behind it, and slowly moves it: hardest for whoever trusts the larger part of the picture.
struct Haul {
  Vec3 half_m;
  float rest_height_m;  ///< of its centre
  double come_s;        ///< the person walks in ...
  double moves_s;       ///< ... and the box moves from here on
  uint32_t look;
};

template <class Place>
void haul(const Haul& h, const Place& place, double t, World& world) {
  const Spot2 rest = place(0.0), behind = {static_cast<double>(h.half_m.x) + 0.36, 0.0};
  const std::array<Waypoint, 4> way = {{{h.come_s, kWideSouthWing},
                                        {h.come_s + 0.35 * (h.moves_s - h.come_s), {rest.x + 0.30, -0.98}},
                                        {h.come_s + 0.65 * (h.moves_s - h.come_s), {rest.x + 0.70, -0.70}},
                                        {h.moves_s - 0.4, rest + behind}}};
  const auto path = [&](double s) { return along(way, s) + (place(s) - rest); };
  Stance person = walk(path, t, mixed({-0.4, 0.0}, {-3.0, 0.0}, rise(h.moves_s - 1.3, h.moves_s - 0.2, t)));
  const Spot2 at = place(t);
  const double lifted = rise(h.moves_s, h.moves_s + 1.5, t);
  const Vec3 centre = to_float(at.x, at.y, static_cast<double>(h.rest_height_m) + 0.05 * lifted);
  const auto yaw = static_cast<float>(0.08 * lifted * wave(t, 5.3));
  hold(person, centre, h.half_m, yaw, 1.12f - h.rest_height_m, rise(h.moves_s - 0.6, h.moves_s - 0.05, t));
  add_person(world, person, h.look);
  add_box(world, centre, h.half_m, yaw, kBigCarton, t > h.moves_s);
}

/// What such a box stands on.
void add_table(World& world, const Haul& h, Spot2 at) {
  const float height_m = h.rest_height_m - h.half_m.z;
  add_box(world, to_float(at.x, at.y, 0.5 * static_cast<double>(height_m)),
          {h.half_m.x, h.half_m.y, 0.5f * height_m}, 0.0f,
          {Pattern::planks, {70, 60, 52}, {130, 116, 100}, 0.10f, 7}, false);
}

constexpr Haul kMovingBox = {{0.16f, 0.41f, 0.42f}, 0.80f + 0.42f, 0.6, 3.2, 1};
constexpr Spot2 kMovingBoxRest = {-0.38, 0.0};

void bare_with_moving_table(World& world) {
  bare_room(world);
  add_table(world, kMovingBox, kMovingBoxRest);
}

Se3d moving_box_camera(double t) {
  static const Sway sway = {{-1.44, 0.0, 1.36}, {0.05, 0.30, 0.07}, {6.3, 4.8, 4.9}, 0, 9, 5.7, -5, 2.5, 4.7};
  return sway_camera(sway, t);
}

void moving_box_movers(double t, World& world) {
  const auto place = [](double s) {
    const double moved = from_rest(std::max(0.0, s - kMovingBox.moves_s), 4.0);
    // Mostly to and fro along the line of sight: hardest to tell from a camera that moves.
    return kMovingBoxRest + Spot2{0.10 * (1.0 - std::cos(kTurn * moved / 6.5)), 0.08 * wave(moved, 9.2)};
  };
  haul(kMovingBox, place, t, world);
}

const Sway& obstructing_sway() {
  static const Sway sway = {{-1.44, 0.0, 1.36}, {0.05, 0.28, 0.05}, {6.3, 4.6, 4.9}, 0, 8, 5.7, -4, 2, 4.7};
  return sway;
}

Se3d obstructing_camera(double t) {
  return sway_camera(obstructing_sway(), t);
}

constexpr Haul kObstructingBox = {{0.12f, 0.40f, 0.82f}, 0.82f, 0.0, 3.0, 4};

void obstructing_movers(double t, World& world) {
  // Led slowly to 0.8 m before the lens, held there while the camera goes on to sway, then back into the
  // room.
  const auto place = [](double s) {
    const Vec3d camera = sway_place(obstructing_sway(), s);
    const double yaw = sway_yaw(obstructing_sway(), s);
    const Spot2 near_by = {camera.x + 0.88 * std::cos(yaw), camera.y + 0.88 * std::sin(yaw)};
    const Spot2 rest = {-0.02, 0.0}, away = {0.20 + 0.08 * wave(s, 4.1), 0.30 * wave(s, 5.9)};
    const double near_share = rise(kObstructingBox.moves_s, 5.4, s);
    return mixed(mixed(rest, near_by, near_share), away, rise(7.6, 9.9, s));
  };
  haul(kObstructingBox, place, t, world);
}

// A stand on which a box is put, or from which it is taken.
constexpr Vec3 kStandHalf = {0.24f, 0.24f, 0.43f};
constexpr Vec3 kCartonHalf = {0.20f, 0.24f, 0.19f};
constexpr Spot2 kStand = {0.45, 0.10};
constexpr float kRestHeightM = 2.0f * kStandHalf.z + kCartonHalf.z;

void add_stand(World& world) {
  add_box(world, to_float(kStand.x, kStand.y, static_cast<double>(kStandHalf.z)), kStandHalf, 0.0f,
          {Pattern::planks, {70, 60, 52}, {130, 116, 100}, 0.10f, 7}, false);
}

void furnished_with_stand(World& world) {
  furnished_room(world);
  add_stand(world);
}

Vec3 at_rest() {
  return to_float(kStand.x, kStand.y, static_cast<double>(kRestHeightM));
}

Se3d stand_camera(double t) {
  static const Sway sway = {{-1.40, 0.0, 1.38}, {0.10, 0.34, 0.07}, {6.3, 4.6, 4.9}, 0, 9, 5.7, -6, 2.5, 4.7};
  return sway_camera(sway, t);
}

/// Strolls close before the camera, between it and the stand.
Spot2 stroll(double t) {
  return {-0.28 + 0.06 * wave(t, 5.3), 0.48 * wave(t, 6.2)};
}

constexpr double kCartonDown = 6.0;

void placing_movers(double t, World& world) {
  const Spot2 before_stand = {kStand.x - 0.02, kStand.y - 0.58};
  const auto path = [&](double s) {
    static const std::array<Waypoint, 6> way = {{{0.8, kWideSouthWing},
                                                 {2.4, {-0.20, -0.62}},
                                                 {3.9, {0.30, -0.70}},
                                                 {4.9, before_stand},
                                                 {6.3, before_stand},
                                                 {7.6, {-0.20, -0.55}}}};
    return mixed(along(way, s), stroll(s - 7.2), rise(7.0, 8.8, s));
  };
  const double turned = rise(4.0, 5.0, t) * (1.0 - rise(6.4, 7.2, t));
  Stance person = walk(path, t, mixed({-0.6, 0.35}, {0.0, 3.0}, turned));
  const float down = static_cast<float>(rise(4.9, 6.0, t));
  const Vec3 carried = before(person, 0.43f, 1.22f);
  const bool held = t < kCartonDown;
  const Vec3 centre = held ? carried + down * (at_rest() - carried) : at_rest();
  const auto turning =
      static_cast<float>((1.0 - static_cast<double>(down)) * static_cast<double>(person.yaw) +
                         static_cast<double>(down) * 0.25 * kTurn);
  const float yaw = held ? turning : static_cast<float>(0.25 * kTurn);
  hold(person, centre, kCartonHalf, yaw, -0.02f, 1.0 - rise(6.05, 6.7, t));
  add_person(world, person, 1);
  add_carried_box(world, centre, kCartonHalf, yaw, kCarton, t, kCartonDown);
}

/// Somebody comes at `arrive_s`, takes the box from the stand at `take_s`, and walks about with it until
/// `leave_s`.
void carry_off(double t, double come_s, double take_s, double leave_s, uint32_t look_number, World& world) {
  const Spot2 before_stand = {kStand.x - 0.02, kStand.y - 0.58};
  const auto path = [&](double s) {
    const std::array<Waypoint, 5> way = {{{come_s, kWideSouthWing},
                                          {0.5 * (come_s + take_s), {-0.25, -0.66}},
                                          {take_s - 0.3, before_stand},
                                          {take_s + 0.9, before_stand},
                                          {take_s + 2.6, {-0.15, -0.55}}}};
    const Spot2 about = stroll(s - take_s - 1.8) + Spot2{0.22, 0.0};
    const Spot2 walk_about = mixed(along(way, s), about, rise(take_s + 1.9, take_s + 3.4, s));
    return mixed(walk_about, Spot2{-0.10, -1.16}, rise(leave_s, leave_s + 1.8, s));
  };
  const double turned = rise(take_s - 1.2, take_s - 0.4, t) * (1.0 - rise(take_s + 1.0, take_s + 2.2, t));
  Stance person = walk(path, t, mixed({-0.7, 0.30}, {0.0, 3.0}, turned));
  const float up = static_cast<float>(rise(take_s, take_s + 1.3, t));
  const Vec3 centre = at_rest() + up * (before(person, 0.43f, 1.20f) - at_rest());
  const auto rest_yaw = static_cast<float>(0.25 * kTurn);
  const float yaw = rest_yaw + up * (person.yaw - rest_yaw);
  hold(person, centre, kCartonHalf, yaw, -0.02f, rise(take_s - 0.7, take_s - 0.05, t));
  add_person(world, person, look_number);
  add_box(world, centre, kCartonHalf, yaw, kCarton, t > take_s);
}

void removing_movers(double t, World& world) {
  carry_off(t, 0.8, 3.8, 10.6, 2, world);
}

constexpr Haul kKidnappedBox = {{0.16f, 0.40f, 0.40f}, 0.80f + 0.40f, 1.4, 4.4, 5};
constexpr Spot2 kKidnappedRest = {-0.42, 0.0};

void bare_with_kidnapping_table(World& world) {
  bare_room(world);
  add_table(world, kKidnappedBox, kKidnappedRest);
}

void kidnapping_movers(double t, World& world) {
  const auto place = [](double s) {
    static constexpr std::array<Waypoint, 6> way = {{{kKidnappedBox.moves_s, kKidnappedRest},
                                                     {6.6, {-0.40, 0.16}},
                                                     {8.4, {-0.36, 0.34}},
                                                     {10.4, {-0.26, -0.10}},
                                                     {12.2, {-0.36, -0.62}},
                                                     {13.8, {-0.64, -1.18}}}};
    return along(way, s);
  };
  haul(kKidnappedBox, place, t, world);
}

constexpr Vec3 kCrateHalf = {0.20f, 0.42f, 0.64f};
constexpr double kCrateDown = 7.6;

void placing_obstructing_movers(double t, World& world) {
  const auto crate = [](double s) {
    static constexpr std::array<Waypoint, 5> way = {{{0.9, {-0.58, -1.16}},
                                                     {3.0, {-0.40, -0.85}},
                                                     {4.4, {-0.30, -0.35}},
                                                     {6.0, {-0.32, 0.08}},
                                                     {7.2, {-0.32, 0.05}}}};
    return along(way, s);
  };
  const Spot2 c = crate(t);
  const double lifted = 0.06 * (1.0 - rise(6.8, kCrateDown, t));
  const Vec3 centre = to_float(c.x, c.y, static_cast<double>(kCrateHalf.z) + lifted);
  const float yaw = static_cast<float>(0.15 * (1.0 - rise(1.0, 6.8, t)));
  const auto path = [&](double s) {
    const Spot2 behind = crate(s) + Spot2{0.50, 0.04};
    return mixed(behind, Spot2{0.35 + 0.1 * wave(s, 4.1), 0.72 * wave(s - 8.0, 4.4)}, rise(7.9, 9.4, s));
  };
  Stance person = walk(path, t, mixed({-2.0, 0.0}, {-0.4, 0.0}, rise(7.7, 8.4, t)));
  hold(person, centre, kCrateHalf, yaw, 0.45f, 1.0 - rise(7.65, 8.3, t));
  add_person(world, person, 3);
  const Stance helper = walk(
      [](double s) {
        return mixed(kNorthWing, Spot2{0.80, 0.55 * wave(s, 5.1)}, rise(2.0, 5.4, s));
      },
      t, {-0.45, 0.0});
  add_person(world, helper, 0);
  add_carried_box(world, centre, kCrateHalf, yaw, kBigCarton, t, kCrateDown);
}

// ---- camera and people together

constexpr double kTourPeriod = 15.0;

/// The person walks round the room; the camera follows on a slightly wider round.
Spot2 round_of_the_room(double turn, double reach_x, double reach_y) {
  return {0.02 + reach_x * std::cos(kTurn * turn), -0.06 + reach_y * std::sin(kTurn * turn)};
}

Spot2 tracked_person(double t) {
  return round_of_the_room(0.62 + from_rest(t, 2.0) / kTourPeriod, 0.92, 0.76);
}

Se3d person_tracking_camera(double t) {
  const double lag = 0.205 + 0.012 * wave(t, 4.3);
  const Spot2 place = round_of_the_room(0.62 - lag + from_rest(t, 2.0) / kTourPeriod, 0.98, 0.80);
  const Spot2 aim = tracked_person(t - 0.1) - place;
  return handheld({place.x, place.y, 1.36 + 0.05 * wave(t, 5.0)},
                  std::atan2(aim.y, aim.x) + 5.0 * kDegree * wave(t, 3.9), -5.0 * kDegree, t);
}

void person_tracking_movers(double t, World& world) {
  const double rate = kTurn / kTourPeriod;
  const double turn = kTurn * (0.62 + from_rest(t, 2.0) / kTourPeriod);
  add_person(world, walk(tracked_person, t, {-0.2 * rate * std::sin(turn), 0.2 * rate * std::cos(turn)}), 4);
}

/// The camera pans over the bare room; two people go round with it, one at each side of the view, so that one
/// of them always leads into what has not been seen yet.
const Sway& synchronous_sway() {
  static const Sway sway = {{-0.62, 0.0, 1.36}, {0.06, 0.10, 0.04}, {8.0, 5.1, 4.9}, 0, 44, 10.5, -5, 2, 4.7};
  return sway;
}

Se3d synchronous_camera(double t) {
  return sway_camera(synchronous_sway(), t);
}

void synchronous_movers(double t, World& world) {
  for (int who = 0; who < 2; ++who) {
    const double side = who == 0 ? 1.0 : -1.0;
    const auto path = [&](double s) {
      const Vec3d camera = sway_place(synchronous_sway(), s);
      const double in = rise(0.8, 2.8, s);
      const double bearing = sway_yaw(synchronous_sway(), s) + side * kDegree * (75.0 - 58.0 * in);
      const double distance = 1.12 + 0.06 * side;
      return Spot2{camera.x + distance * std::cos(bearing), camera.y + distance * std::sin(bearing)};
    };
    const double yaw = sway_yaw(synchronous_sway(), t);
    add_person(world, walk(path, t, {-0.9 * std::cos(yaw), -0.9 * std::sin(yaw)}),
               static_cast<uint32_t>(1 + 2 * who));
  }
}

// ---- out of range

Se3d hall_camera(double t) {
  static const Sway sway = {{-5.0, 0.0, 1.36}, {0.12, 0.36, 0.06}, {6.3, 4.6, 4.9}, 0, 8, 5.7, -5, 2.5, 4.7};
  return sway_camera(sway, t);
}

/// Three people who cross before what is too far to be measured.
void hall_movers(double t, World& world) {
  const Spot2 wings[3] = {{-2.95, 3.0}, {-2.55, -3.2}, {-3.35, -2.7}};
  const double from[3] = {0.6, 0.8, 1.6}, to[3] = {3.0, 3.6, 4.2};
  for (int who = 0; who < 3; ++who) {
    const auto path = [&](double s) {
      const Spot2 lanes[3] = {{-2.95 + 0.08 * wave(s, 3.7), 0.95 * wave(s, 6.1, 0.12)},
                              {-2.50 + 0.08 * wave(s, 4.3), -1.05 * wave(s, 6.9, 0.08)},
                              {-3.35 + 0.06 * wave(s, 5.1), 0.85 * wave(s, 5.3, 0.60)}};
      return mixed(wings[who], lanes[who], rise(from[who], to[who], s));
    };
    add_person(world, walk(path, t, {-0.25, 0.0}), static_cast<uint32_t>(who));
  }
}

// ---- too near

constexpr double kHandComes_s = 1.6, kHandThere_s = 2.6;

/// A hand, from the side, to 20 cm before the lens, where it stays; the arm lies hidden behind it.
void near_movers(double t, World& world) {
  const auto aside = static_cast<float>(0.34 * (1.0 - rise(kHandComes_s, kHandThere_s, t)));
  const Se3 T_world_cam = cast<float>(static_camera(t));
  const Material skin = {Pattern::cloud, {214, 168, 140}, {190, 140, 112}, 0.02f, 7};
  const Vec3 palm_cam = {aside, -0.04f, 0.20f};
  const auto put = [&](Shape shape) {
    shape.moving = true;
    world.shapes.push_back(shape);
  };
  Shape palm = make_ellipsoid({}, {0.050f, 0.058f, 0.022f}, skin);
  palm.T_world_local = T_world_cam * Se3{Mat3{}, palm_cam};
  put(palm);
  put(make_capsule(T_world_cam * (1.15f * palm_cam), T_world_cam * (2.4f * palm_cam), 0.036f,
                   {Pattern::stripes, {40, 60, 130}, {220, 222, 230}, 0.05f, 1}));
}

// ---- a hand on the lens

/// Sees the whole east half of the room within the first 6 s, then again and again.
Se3d looking_about_camera(double t) {
  static const Sway sway = {{-1.05, 0.0, 1.36}, {0.22, 0.48, 0.07}, {6.4, 6.4, 4.4}, 0, 30, 6.4, -6, 3, 4.7};
  return sway_camera(sway, t);
}

/// For three seconds, in which the camera turns from one end of its view to the other.
bool hand_on_lens(double t) {
  return t >= 9.0 && t < 12.0;
}

constexpr double kFirstKidnapping = 6.0, kSecondKidnapping = 10.0, kCarried = 0.35;

/// Carried off while covered, to where it was four seconds before.
Se3d kidnapped_camera(double t) {
  const double half = 0.5 * kCarried;
  const int jumps = (t >= kFirstKidnapping + half ? 1 : 0) + (t >= kSecondKidnapping + half ? 1 : 0);
  return looking_about_camera(t - 4.0 * jumps);
}

bool carried_off(double t) {
  return (t >= kFirstKidnapping && t < kFirstKidnapping + kCarried) ||
         (t >= kSecondKidnapping && t < kSecondKidnapping + kCarried);
}

}  // namespace

const std::vector<Scene>& all_scenes() {
  static const std::vector<Scene> scenes = {
      {"static", 10, false, furnished_room, no_movers, static_camera},
      {"balloon", 12, true, furnished_room, balloon_movers, balloon_camera},
      {"balloon_tracking", 12, true, furnished_room, balloon_tracking_movers, balloon_tracking_camera},
      {"crowd", 12, true, furnished_room, crowd_movers, crowd_camera},
      {"crowd_start", 12, true, furnished_room, crowd_start_movers, crowd_start_camera},
      {"crowd_close", 12, true, bare_room, crowd_close_movers, crowd_close_camera},
      {"moving_box", 12, true, bare_with_moving_table, moving_box_movers, moving_box_camera},
      {"obstructing_box", 12, true, furnished_room, obstructing_movers, obstructing_camera},
      {"placing_box", 14, true, furnished_with_stand, placing_movers, stand_camera},
      {"removing_box", 13, true, furnished_with_stand, removing_movers, stand_camera},
      {"placing_obstructing_box", 12, true, furnished_room, placing_obstructing_movers, stand_camera},
      {"person_tracking", 14, true, furnished_room, person_tracking_movers, person_tracking_camera},
      {"synchronous", 12, true, bare_room, synchronous_movers, synchronous_camera},
      {"kidnapping_box", 14, true, bare_with_kidnapping_table, kidnapping_movers, moving_box_camera},
      {"loop", 20, false, furnished_room, no_movers, loop_camera},
      {"fast", 10, false, furnished_room, no_movers, fast_camera},
      {"covered", 16, false, furnished_room, no_movers, looking_about_camera, hand_on_lens},
      {"camera_kidnapped", 14, false, furnished_room, no_movers, kidnapped_camera, carried_off},
      {"long_loop", 57, false, suite_of_rooms, no_movers, long_loop_camera},
      {"corridor", 136, false, corridor, no_movers, corridor_camera},
      {"hall", 12, true, hall, hall_movers, hall_camera, nullptr, true},
      {"near", 10, true, furnished_room, near_movers, static_camera, nullptr, true}};
  return scenes;
}

const Scene* find_scene(const std::string& name) {
  for (const Scene& scene : all_scenes())
    if (name == scene.name) return &scene;
  return nullptr;
}

World world_at(const Scene& scene, double t_s, bool without_movers) {
  World world;
  scene.still(world);
  if (!without_movers) scene.movers(t_s, world);
  return world;
}

}  // namespace stillmap::synthetic
