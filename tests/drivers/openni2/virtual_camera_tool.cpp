// virtual_camera_tool render SCENE FRAMES COUNT [raw]     the images that the virtual camera sends
//                     record FILE.oni COUNT               what it sends, by OpenNI2's recorder; needs the
//                     variables of
//                                                         virtual_camera.hpp, and the library that knows the
//                                                         camera

#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "tests/drivers/openni2/virtual_studio.hpp"

namespace {

using namespace stillmap::virtual_camera;

std::string run(const std::vector<std::string>& words) {
  if (words.size() >= 4 && words[0] == "render")
    return render(words[1], words[2], std::stoi(words[3]), words.size() > 4 && words[4] == "raw");
  if (words.size() == 3 && words[0] == "record") {
    const Mapped control(std::getenv(kControlVariable), true);
    if (control.size() < sizeof(Control)) return std::string(kControlVariable) + " names no control file";
    return record(*static_cast<Control*>(control.memory()), words[1], std::stoi(words[2]));
  }
  return "render SCENE FRAMES COUNT [raw] | record FILE.oni COUNT";
}

}  // namespace

int main(int count, char** words) {
  const std::string wrong = run({words + 1, words + count});
  if (wrong.empty()) return 0;
  std::fprintf(stderr, "virtual_camera_tool: %s\n", wrong.c_str());
  return 1;
}
