#include "drivers/synthetic/builders.hpp"
#include "drivers/synthetic/materials.hpp"

namespace stillmap::synthetic {

namespace {

constexpr Vec3 kRoomHalfM = {2.5f, 2.0f, 1.3f};

void add(World& world, const Shape& shape) {
  world.shapes.push_back(shape);
}

void add_walls(World& world, const Material& walls, const Material& floor, const Material& ceiling) {
  world.room = {floor, ceiling};
  add(world, {Kind::room, false, kRoomHalfM, {Mat3{}, {0, 0, kRoomHalfM.z}}, walls});
}

Material cloth(Vec3 a, Vec3 b, float scale_m, uint32_t variant) {
  return {Pattern::cloud, a, b, scale_m, variant};
}

void bookshelf(World& world) {  // east wall, south half
  const float x0 = 2.14f, x1 = 2.5f, y0 = -1.78f, y1 = -0.32f, top = 2.05f, board = 0.02f;
  const Material frame = wood(1);
  add(world, make_block({x1 - 0.02f, y0, 0}, {x1, y1, top}, wood(2)));
  add(world, make_block({x0, y0, 0}, {x1, y0 + 0.03f, top}, frame));
  add(world, make_block({x0, y1 - 0.03f, 0}, {x1, y1, top}, frame));
  for (int i = 0; i < 6; ++i) {
    const float z = 0.05f + 0.39f * static_cast<float>(i);
    add(world, make_block({x0, y0, z}, {x1, y1, z + 2 * board}, frame));
  }
  // Blocks of books of several heights and depths, with gaps between them.
  const struct {
    int shelf;
    float from, to, height, back;
  } books[] = {{0, 0.05f, 0.55f, 0.30f, 0.05f}, {0, 0.70f, 1.35f, 0.26f, 0.09f},
               {1, 0.05f, 0.40f, 0.24f, 0.06f}, {1, 0.52f, 0.95f, 0.31f, 0.03f},
               {2, 0.10f, 0.80f, 0.29f, 0.07f}, {2, 1.02f, 1.40f, 0.22f, 0.12f},
               {3, 0.05f, 0.30f, 0.27f, 0.05f}, {3, 0.62f, 1.38f, 0.30f, 0.04f},
               {4, 0.05f, 0.66f, 0.25f, 0.08f}, {4, 0.90f, 1.20f, 0.30f, 0.05f}};
  uint32_t variant = 1;
  for (const auto& b : books) {
    const float z = 0.09f + 0.39f * static_cast<float>(b.shelf);
    const Material spines = {Pattern::spines, {120, 90, 70}, {225, 215, 190}, 0.035f, variant++};
    add(world, make_block({x0 + b.back, y0 + b.from, z}, {x1 - 0.05f, y0 + b.to, z + b.height}, spines));
  }
  add(world, make_ellipsoid({2.30f, -0.85f, 1.36f}, {0.09f, 0.09f, 0.10f},
                            cloth({40, 90, 150}, {190, 210, 230}, 0.05f, 3)));
}

void desk(World& world) {  // east wall, north half
  const float x0 = 1.78f, x1 = 2.46f, y0 = 0.15f, y1 = 1.75f;
  add(world, make_block({x0, y0, 0.71f}, {x1, y1, 0.75f}, wood(3)));
  for (const float x : {x0 + 0.04f, x1 - 0.04f})
    for (const float y : {y0 + 0.05f, y1 - 0.05f})
      add(world,
          make_capsule({x, y, 0.0f}, {x, y, 0.70f}, 0.03f, {Pattern::plain, {70, 72, 78}, {}, 0.1f, 0}));
  add(world, make_block({1.88f, 1.30f, 0.10f}, {2.40f, 1.66f, 0.70f},
                        cloth({150, 150, 140}, {190, 188, 176}, 0.2f, 2)));
  add(world, make_box({2.25f, 0.85f, 1.04f}, {0.025f, 0.31f, 0.19f},
                      {Pattern::poster, {30, 50, 90}, {90, 160, 220}, 0.09f, 9}, 0.12f));
  add(world, make_box({2.27f, 0.85f, 0.80f}, {0.07f, 0.10f, 0.05f},
                      {Pattern::plain, {40, 40, 44}, {}, 0.1f, 0}, 0.12f));
  add(world, make_box({1.98f, 0.85f, 0.765f}, {0.08f, 0.22f, 0.015f},
                      {Pattern::checks, {60, 60, 64}, {150, 150, 150}, 0.04f, 1}, -0.1f));
  add(world, make_box({2.15f, 0.35f, 0.81f}, {0.15f, 0.11f, 0.06f}, print({170, 60, 50}, 0.05f, 4), 0.4f));
  add(world, make_capsule({2.20f, 1.50f, 0.75f}, {2.20f, 1.50f, 1.10f}, 0.015f,
                          {Pattern::plain, {180, 180, 185}, {}, 0.1f, 0}));
  add(world, make_ellipsoid({2.16f, 1.47f, 1.16f}, {0.13f, 0.13f, 0.09f},
                            {Pattern::stripes, {230, 190, 90}, {180, 120, 50}, 0.04f, 0}));
  // The chair, pushed under.
  const Material seat = cloth({150, 40, 40}, {200, 80, 70}, 0.04f, 5);
  add(world, make_box({1.78f, 0.55f, 0.45f}, {0.21f, 0.21f, 0.035f}, seat, 0.1f));
  add(world, make_box({1.58f, 0.53f, 0.75f}, {0.025f, 0.20f, 0.22f}, seat, 0.1f));
  for (const float dx : {-0.18f, 0.18f})
    for (const float dy : {-0.18f, 0.18f})
      add(world, make_capsule({1.78f + dx, 0.55f + dy, 0.0f}, {1.78f + dx, 0.55f + dy, 0.43f}, 0.02f,
                              {Pattern::plain, {60, 45, 35}, {}, 0.1f, 0}));
}

void sofa_and_window(World& world) {  // north wall
  const Material fabric = {Pattern::checks, {70, 96, 80}, {120, 150, 128}, 0.11f, 2};
  add(world, make_block({-1.05f, 1.22f, 0.08f}, {0.85f, 1.98f, 0.42f}, fabric));
  add(world, make_block({-1.05f, 1.76f, 0.42f}, {0.85f, 1.98f, 0.86f}, fabric));
  add(world, make_block({-1.05f, 1.22f, 0.42f}, {-0.87f, 1.76f, 0.62f}, fabric));
  add(world, make_block({0.67f, 1.22f, 0.42f}, {0.85f, 1.76f, 0.62f}, fabric));
  add(world, make_ellipsoid({-0.60f, 1.64f, 0.60f}, {0.20f, 0.12f, 0.19f},
                            {Pattern::stripes, {200, 120, 40}, {240, 210, 160}, 0.07f, 1}, 0.2f));
  add(world, make_ellipsoid({0.36f, 1.62f, 0.58f}, {0.19f, 0.11f, 0.17f},
                            {Pattern::checks, {60, 70, 140}, {190, 190, 220}, 0.08f, 3}, -0.3f));
  // Window: frame, sill, curtains; the pane is a bright print on the wall.
  const Material frame = {Pattern::paint, {225, 225, 220}, {205, 205, 200}, 0.3f, 1};
  add(world, make_block({-0.62f, 1.985f, 1.16f}, {0.50f, 2.0f, 2.14f}, print({150, 190, 225}, 0.17f, 6)));
  add(world, make_block({-0.70f, 1.93f, 2.12f}, {0.58f, 2.0f, 2.20f}, frame));
  add(world, make_block({-0.70f, 1.93f, 1.10f}, {-0.62f, 2.0f, 2.20f}, frame));
  add(world, make_block({0.50f, 1.93f, 1.10f}, {0.58f, 2.0f, 2.20f}, frame));
  add(world, make_block({-0.08f, 1.95f, 1.16f}, {-0.03f, 2.0f, 2.14f}, frame));
  add(world, make_block({-0.78f, 1.82f, 1.06f}, {0.66f, 2.0f, 1.11f}, frame));
  for (int i = 0; i < 3; ++i) {
    const float dx = 0.09f * static_cast<float>(i);
    const Material curtain = {Pattern::stripes, {170, 70, 80}, {214, 150, 140}, 0.16f, 3};
    add(world, make_capsule({-1.00f + dx, 1.92f, 0.95f}, {-1.00f + dx, 1.92f, 2.25f}, 0.055f, curtain));
    add(world, make_capsule({0.72f + dx, 1.92f, 0.95f}, {0.72f + dx, 1.92f, 2.25f}, 0.055f, curtain));
  }
}

void plant(World& world, float x, float y, uint32_t variant) {
  add(world, make_capsule({x, y, 0.12f}, {x, y, 0.30f}, 0.16f,
                          {Pattern::stripes, {150, 84, 56}, {190, 120, 84}, 0.1f, variant}));
  add(world, make_capsule({x, y, 0.40f}, {x + 0.03f, y, 1.00f}, 0.025f, wood(variant)));
  const Material leaves = {Pattern::cloud, {30, 74, 34}, {120, 168, 76}, 0.05f, variant};
  add(world, make_ellipsoid({x, y + 0.02f, 0.95f}, {0.24f, 0.20f, 0.16f}, leaves, 0.4f));
  add(world, make_ellipsoid({x - 0.09f, y - 0.10f, 1.17f}, {0.19f, 0.16f, 0.13f}, leaves, 1.1f));
  add(world, make_ellipsoid({x + 0.10f, y + 0.04f, 1.33f}, {0.16f, 0.20f, 0.12f}, leaves, -0.5f));
  add(world, make_ellipsoid({x - 0.02f, y - 0.02f, 1.52f}, {0.11f, 0.12f, 0.13f}, leaves, 0.0f));
}

void cabinet_and_radiator(World& world) {  // south wall
  add(world, make_block({-0.30f, -2.0f, 0.06f}, {1.15f, -1.54f, 0.86f}, wood(5)));
  add(world, make_block({-0.34f, -2.0f, 0.86f}, {1.19f, -1.50f, 0.89f}, wood(6)));
  for (const float x : {-0.05f, 0.42f, 0.90f})
    add(world, make_ellipsoid({x, -1.53f, 0.55f}, {0.02f, 0.03f, 0.02f},
                              {Pattern::plain, {210, 190, 90}, {}, 0.1f, 0}));
  add(world, make_ellipsoid({0.05f, -1.75f, 1.06f}, {0.11f, 0.11f, 0.17f},
                            {Pattern::stripes, {40, 80, 150}, {220, 225, 235}, 0.08f, 2}));
  add(world, make_box({0.50f, -1.76f, 0.97f}, {0.17f, 0.13f, 0.08f}, print({60, 130, 90}, 0.06f, 7), 0.3f));
  add(world, make_box({0.52f, -1.75f, 1.09f}, {0.12f, 0.09f, 0.04f}, print({190, 150, 60}, 0.05f, 8), -0.2f));
  add(world, make_box({0.92f, -1.78f, 1.05f}, {0.10f, 0.08f, 0.16f},
                      {Pattern::checks, {50, 50, 60}, {200, 190, 170}, 0.07f, 4}, 0.15f));
  const Material enamel = {Pattern::paint, {232, 230, 222}, {206, 204, 198}, 0.15f, 2};
  for (int i = 0; i < 8; ++i) {
    const float x = -1.86f + 0.13f * static_cast<float>(i);
    add(world, make_block({x, -1.99f, 0.14f}, {x + 0.09f, -1.87f, 0.78f}, enamel));
  }
  add(world, make_capsule({1.62f, -1.70f, 0.03f}, {1.62f, -1.70f, 1.50f}, 0.02f,
                          {Pattern::plain, {70, 70, 74}, {}, 0.1f, 0}));
  add(world, make_ellipsoid({1.62f, -1.70f, 1.58f}, {0.19f, 0.19f, 0.15f},
                            {Pattern::stripes, {235, 215, 160}, {200, 170, 110}, 0.06f, 4}));
}

void west_side(World& world) {
  add(world, make_block({-2.5f, -1.35f, 0.05f}, {-1.98f, -0.15f, 2.10f}, wood(8)));
  add(world, make_block({-1.99f, -0.77f, 0.10f}, {-1.96f, -0.73f, 2.05f}, wood(9)));
  add(world, make_block({-2.5f, 0.30f, 0.0f}, {-2.05f, 1.10f, 0.58f}, wood(10)));
  add(world, make_box({-2.28f, 0.62f, 0.72f}, {0.14f, 0.20f, 0.14f}, print({90, 80, 150}, 0.07f, 11), 0.3f));
  add(world, make_ellipsoid({-2.26f, 0.97f, 0.70f}, {0.09f, 0.09f, 0.13f},
                            cloth({160, 90, 60}, {230, 190, 150}, 0.06f, 6)));
}

void wall_prints(World& world) {
  add(world, make_block({2.485f, 0.25f, 1.35f}, {2.5f, 0.95f, 2.15f}, print({190, 180, 150}, 0.13f, 12)));
  add(world, make_block({2.485f, 1.10f, 1.30f}, {2.5f, 1.70f, 1.90f}, print({60, 90, 140}, 0.10f, 13)));
  add(world, make_block({-0.10f, -2.0f, 1.40f}, {0.60f, -1.985f, 2.20f}, print({170, 90, 70}, 0.12f, 14)));
  add(world, make_block({0.85f, -2.0f, 1.35f}, {1.35f, -1.985f, 2.00f}, print({90, 140, 100}, 0.09f, 15)));
  add(world, make_block({-1.75f, -2.0f, 1.10f}, {-0.85f, -1.985f, 1.95f}, print({200, 190, 170}, 0.15f, 16)));
  add(world, make_block({-1.95f, 1.985f, 1.20f}, {-1.25f, 2.0f, 2.10f}, print({70, 80, 110}, 0.14f, 17)));
  add(world, make_block({1.15f, 1.985f, 1.60f}, {1.85f, 2.0f, 2.25f}, print({180, 150, 80}, 0.11f, 18)));
  add(world, make_block({-2.5f, 0.25f, 1.20f}, {-2.485f, 1.15f, 2.05f}, print({120, 60, 90}, 0.13f, 19)));
}

// ---- the suite: 4 x 2 rooms of 5 x 4 m, thick boxes between them

constexpr Vec3 kSuiteHalfM = {10.0f, 4.0f, 1.3f};
constexpr float kWallHalfM = 0.07f;
constexpr float kDoorHalfM = 0.55f;
constexpr float kDoorHeightM = 2.05f;

/// Adds a piece that is made for the middle room (see above), turned to the left and moved.
void put(World& world, void (*piece)(World&), float x, float y, int quarter_turns) {
  World alone;
  piece(alone);
  const Se3 T_world_piece = {yaw_rotation(1.57079633f * static_cast<float>(quarter_turns)), {x, y, 0}};
  for (Shape shape : alone.shapes) {
    shape.T_world_local = T_world_piece * shape.T_world_local;
    add(world, shape);
  }
}

/// From (x0, y0) to (x1, y1), one of which pairs is equal.
void inner_wall(World& world, float x0, float y0, float x1, float y1, const Material& material,
                float from_z = 0.0f) {
  const float thick_x = x0 == x1 ? kWallHalfM : 0.0f, thick_y = y0 == y1 ? kWallHalfM : 0.0f;
  add(world, make_block({x0 - thick_x, y0 - thick_y, from_z},
                        {x1 + thick_x, y1 + thick_y, 2.0f * kSuiteHalfM.z}, material));
}

/// Walls across the suite, each with a door to the south and one to the north, and the one along it.
void inner_walls(World& world) {
  const struct {
    float x, south_door, north_door;
  } across[] = {{-5.0f, -1.60f, 1.70f}, {0.0f, -1.45f, 2.50f}, {5.0f, -2.40f, 1.50f}};
  uint32_t variant = 1;
  for (const auto& w : across) {
    inner_wall(world, w.x, -kSuiteHalfM.y, w.x, w.south_door - kDoorHalfM, wallpaper(variant));
    inner_wall(world, w.x, w.south_door + kDoorHalfM, w.x, w.north_door - kDoorHalfM, wallpaper(variant + 1));
    inner_wall(world, w.x, w.north_door + kDoorHalfM, w.x, kSuiteHalfM.y, wallpaper(variant + 2));
    for (const float door : {w.south_door, w.north_door})
      inner_wall(world, w.x, door - kDoorHalfM, w.x, door + kDoorHalfM, wallpaper(variant), kDoorHeightM);
    variant += 3;
  }
  const float east_door = 7.6f, west_door = -7.4f;
  inner_wall(world, -kSuiteHalfM.x, 0, west_door - kDoorHalfM, 0, wallpaper(10));
  inner_wall(world, west_door + kDoorHalfM, 0, -5.0f, 0, wallpaper(11));
  inner_wall(world, -5.0f, 0, 0, 0, wallpaper(12));
  inner_wall(world, 0, 0, 5.0f, 0, wallpaper(13));
  inner_wall(world, 5.0f, 0, east_door - kDoorHalfM, 0, wallpaper(14));
  inner_wall(world, east_door + kDoorHalfM, 0, kSuiteHalfM.x, 0, wallpaper(15));
  for (const float door : {west_door, east_door})
    inner_wall(world, door - kDoorHalfM, 0, door + kDoorHalfM, 0, wallpaper(16), kDoorHeightM);
}

/// Prints that stick out of a wall on its two sides; of the outer walls one sees only the inner side.
void suite_prints(World& world) {
  const struct {
    float x, y;  ///< middle, in the plane of the wall
    float width, low, high;
    bool across;  ///< on a wall along y
  } prints[] = {{-5.0f, -3.0f, 1.0f, 1.1f, 2.0f, true},  {-5.0f, 0.55f, 0.8f, 1.2f, 2.1f, true},
                {0.0f, -3.1f, 1.1f, 2.1f, 2.45f, true},  {0.0f, 1.1f, 1.0f, 1.0f, 1.9f, true},
                {0.0f, 3.55f, 0.6f, 1.2f, 2.0f, true},   {5.0f, -1.0f, 0.9f, 1.1f, 2.0f, true},
                {5.0f, 3.0f, 1.2f, 1.2f, 2.1f, true},    {5.0f, -3.5f, 0.7f, 1.3f, 1.9f, true},
                {-9.0f, 0.0f, 1.1f, 1.1f, 1.9f, false},  {-5.9f, 0.0f, 0.9f, 1.2f, 2.1f, false},
                {-3.6f, 0.0f, 0.8f, 1.3f, 2.0f, false},  {-1.2f, 0.0f, 1.0f, 1.3f, 2.2f, false},
                {0.8f, 0.0f, 0.9f, 1.2f, 1.9f, false},   {4.0f, 0.0f, 1.1f, 1.1f, 2.0f, false},
                {6.0f, 0.0f, 1.0f, 1.1f, 2.1f, false},   {9.1f, 0.0f, 0.9f, 1.2f, 2.0f, false},
                {-9.3f, -4.0f, 0.7f, 1.1f, 2.0f, false}, {-6.2f, -4.0f, 1.2f, 1.0f, 1.8f, false},
                {-4.3f, -4.0f, 0.9f, 1.2f, 2.0f, false}, {1.3f, -4.0f, 1.1f, 1.1f, 2.1f, false},
                {3.2f, -4.0f, 1.0f, 1.3f, 2.0f, false},  {5.7f, -4.0f, 0.9f, 1.1f, 1.9f, false},
                {9.0f, -4.0f, 1.0f, 1.2f, 2.1f, false},  {8.6f, 4.0f, 1.0f, 1.2f, 2.1f, false},
                {6.6f, 4.0f, 1.1f, 1.3f, 2.1f, false},   {1.0f, 4.0f, 0.8f, 1.0f, 2.0f, false},
                {-0.8f, 4.0f, 1.0f, 1.1f, 2.1f, false},  {-3.9f, 4.0f, 1.0f, 1.2f, 2.0f, false},
                {-6.5f, 4.0f, 1.2f, 1.2f, 2.0f, false},  {-8.6f, 4.0f, 0.8f, 1.3f, 2.1f, false},
                {-10.0f, -0.9f, 1.0f, 1.1f, 2.0f, true}, {-10.0f, -2.5f, 1.1f, 1.3f, 2.1f, true},
                {-10.0f, 0.7f, 0.7f, 1.2f, 2.0f, true},  {-10.0f, 3.6f, 0.6f, 1.1f, 2.0f, true},
                {10.0f, 0.9f, 0.9f, 1.1f, 2.0f, true},   {10.0f, 2.9f, 1.2f, 1.3f, 2.1f, true},
                {10.0f, -0.6f, 0.7f, 1.0f, 2.0f, true},  {10.0f, -3.6f, 0.6f, 1.2f, 2.1f, true}};
  const Vec3 grounds[5] = {{190, 180, 150}, {60, 90, 140}, {170, 90, 70}, {90, 140, 100}, {120, 60, 90}};
  uint32_t variant = 30;
  for (const auto& p : prints) {
    const float out = kWallHalfM + 0.012f, half = 0.5f * p.width;
    const Vec3 reach = p.across ? Vec3{out, half, 0} : Vec3{half, out, 0};
    add(world,
        make_block({p.x - reach.x, p.y - reach.y, p.low}, {p.x + reach.x, p.y + reach.y, p.high},
                   print(grounds[variant % 5], 0.09f + 0.01f * static_cast<float>(variant % 6), variant)));
    ++variant;
  }
}

/// Its middle at (x, y), two things on it.
void table(World& world, float x, float y, uint32_t variant) {
  const float top = 0.72f;
  add(world, make_block({x - 0.45f, y - 0.35f, top - 0.04f}, {x + 0.45f, y + 0.35f, top}, wood(variant)));
  for (const float dx : {-0.38f, 0.38f})
    for (const float dy : {-0.28f, 0.28f})
      add(world,
          make_capsule({x + dx, y + dy, 0.0f}, {x + dx, y + dy, top - 0.05f}, 0.03f, wood(variant + 1)));
  add(world, make_box({x - 0.18f, y, top + 0.09f}, {0.14f, 0.10f, 0.09f},
                      print({150, 110, 60}, 0.05f, variant), 0.3f));
  add(world, make_ellipsoid({x + 0.2f, y + 0.08f, top + 0.12f}, {0.09f, 0.09f, 0.12f},
                            {Pattern::stripes, {40, 80, 150}, {220, 225, 235}, 0.06f, variant}));
}

}  // namespace

void furnished_room(World& world) {
  add_walls(world, {Pattern::wallpaper, {206, 198, 178}, {168, 164, 158}, 0.16f, 0},
            {Pattern::planks, {112, 80, 52}, {190, 150, 106}, 0.14f, 0},
            {Pattern::paint, {226, 226, 222}, {204, 206, 208}, 0.35f, 4});
  bookshelf(world);
  desk(world);
  sofa_and_window(world);
  cabinet_and_radiator(world);
  west_side(world);
  wall_prints(world);
  plant(world, 1.35f, 1.62f, 1);
  plant(world, -2.15f, 1.62f, 2);
  add(world, make_block({-0.95f, -0.85f, 0.0f}, {0.95f, 0.75f, 0.008f},
                        {Pattern::checks, {130, 50, 46}, {196, 160, 110}, 0.3f, 5}));
  add(world, make_ellipsoid({0.2f, 0.1f, 2.46f}, {0.22f, 0.22f, 0.12f},
                            {Pattern::plain, {250, 246, 226}, {}, 0.1f, 0}));
}

void bare_room(World& world) {
  add_walls(world, {Pattern::paint, {196, 194, 184}, {178, 178, 172}, 0.8f, 0},
            {Pattern::paint, {150, 146, 138}, {132, 130, 126}, 0.7f, 1},
            {Pattern::paint, {220, 220, 216}, {208, 208, 206}, 0.9f, 2});
  add(world, make_box({2.00f, -1.20f, 0.45f}, {0.35f, 0.45f, 0.45f},
                      {Pattern::paint, {150, 110, 90}, {134, 98, 80}, 0.4f, 3}, 0.2f));
  add(world, make_box({1.95f, 1.25f, 0.70f}, {0.30f, 0.30f, 0.70f},
                      {Pattern::paint, {96, 116, 140}, {84, 102, 124}, 0.4f, 4}, -0.35f));
  add(world, make_box({1.00f, 1.67f, 0.35f}, {0.40f, 0.26f, 0.35f},
                      {Pattern::paint, {120, 140, 104}, {106, 124, 92}, 0.4f, 5}, 0.1f));
  add(world, make_box({0.50f, -1.66f, 0.55f}, {0.30f, 0.24f, 0.55f},
                      {Pattern::paint, {168, 150, 96}, {150, 134, 86}, 0.4f, 6}, 0.3f));
}

void suite_of_rooms(World& world) {
  world.room = {{Pattern::planks, {112, 80, 52}, {190, 150, 106}, 0.14f, 0},
                {Pattern::cloud, {226, 226, 222}, {196, 198, 202}, 0.35f, 4}};
  add(world, {Kind::room, false, kSuiteHalfM, {Mat3{}, {0, 0, kSuiteHalfM.z}}, wallpaper(0)});
  inner_walls(world);
  suite_prints(world);
  // What stands against the walls, the south row from the west, then the north row from the east.
  put(world, desk, -7.5f, -1.5f, 2);
  put(world, bookshelf, -7.0f, -1.5f, 3);
  put(world, sofa_and_window, -2.5f, -2.0f, 2);
  put(world, bookshelf, -2.57f, -2.0f, 0);
  put(world, cabinet_and_radiator, -2.5f, -2.07f, 2);
  put(world, desk, 2.3f, -1.5f, 3);
  put(world, west_side, 2.5f, -2.57f, 3);
  put(world, sofa_and_window, 8.0f, -2.2f, 3);
  put(world, bookshelf, 8.3f, -1.5f, 3);
  put(world, desk, 7.5f, 2.0f, 0);
  put(world, cabinet_and_radiator, 7.5f, 2.0f, 2);
  put(world, sofa_and_window, 2.8f, 2.0f, 0);
  put(world, bookshelf, 3.4f, 2.57f, 3);
  put(world, desk, -1.2f, 1.5f, 1);
  put(world, west_side, -2.5f, 2.57f, 1);
  put(world, bookshelf, -2.43f, 2.0f, 2);
  put(world, sofa_and_window, -8.0f, 2.2f, 1);
  put(world, cabinet_and_radiator, -7.5f, 2.0f, 2);
  table(world, -7.2f, -1.6f, 40);
  table(world, 7.2f, -1.7f, 42);
  table(world, 7.0f, 1.7f, 44);
  table(world, -7.2f, 1.8f, 46);
  plant(world, 0.55f, -3.45f, 1);
  plant(world, 5.6f, -0.55f, 2);
  plant(world, 9.45f, 0.60f, 3);
  plant(world, 4.45f, 3.45f, 4);
  plant(world, 0.55f, 0.55f, 5);
  plant(world, -5.6f, 0.55f, 6);
  plant(world, -5.6f, -3.45f, 7);
  uint32_t variant = 5;
  for (const float y : {-2.0f, 2.0f})
    for (const float x : {-7.5f, -2.5f, 2.5f, 7.5f}) {
      add(world, make_block({x - 1.1f, y - 0.8f, 0.0f}, {x + 1.1f, y + 0.8f, 0.008f},
                            {Pattern::checks, {130, 50, 46}, {196, 160, 110}, 0.3f, variant++}));
      add(world, make_ellipsoid({x, y, 2.46f}, {0.22f, 0.22f, 0.12f},
                                {Pattern::plain, {250, 246, 226}, {}, 0.1f, 0}));
    }
}

void hall(World& world) {
  constexpr Vec3 kHalfM = {7.0f, 4.5f, 2.25f};
  world.room = {{Pattern::planks, {112, 80, 52}, {190, 150, 106}, 0.16f, 3},
                {Pattern::paint, {226, 226, 222}, {204, 206, 208}, 0.6f, 4}};
  add(world, {Kind::room, false, kHalfM, {Mat3{}, {0, 0, kHalfM.z}}, wallpaper(2)});
  for (const float y : {-2.05f, 2.05f})
    add(world, make_capsule({-1.45f, y, 0.0f}, {-1.45f, y, 4.3f}, 0.22f, print({150, 160, 170}, 0.14f, 20)));
  add(world, make_box({-1.75f, 1.42f, 0.42f}, {0.26f, 0.30f, 0.42f}, wood(11), 0.3f));
  add(world, make_box({-1.72f, 1.38f, 0.98f}, {0.17f, 0.20f, 0.14f}, print({170, 60, 50}, 0.06f, 21), -0.2f));
  add(world,
      make_box({-1.70f, -1.40f, 0.56f}, {0.28f, 0.32f, 0.56f}, print({60, 130, 90}, 0.11f, 22), -0.35f));
  add(world, make_ellipsoid({-1.70f, -1.40f, 1.27f}, {0.16f, 0.16f, 0.15f},
                            {Pattern::stripes, {40, 80, 150}, {220, 225, 235}, 0.07f, 5}));
  add(world, make_block({-1.30f, -0.75f, 0.0f}, {-0.90f, 0.85f, 0.44f}, wood(12)));  // a bench
  add(world, make_block({-4.20f, -1.50f, 0.0f}, {-1.20f, 1.10f, 0.008f},
                        {Pattern::checks, {130, 50, 46}, {196, 160, 110}, 0.3f, 6}));
}

}  // namespace stillmap::synthetic
