#pragma once

// The paper's Tables II and III: RMSE of the absolute trajectory error in metres on dynamic scenes of TUM,
// and on the Bonn data set. SF: StaticFusion; DS (G), DS (N+G): DynaSLAM, geometric and with the neural
// network; MF: MaskFusion.

#include <array>

namespace stillmap {

inline constexpr double kNotInPaper = -1;

struct PaperRow {
  const char* sequence;    ///< as folders of the data set end
  const char* paper_name;  ///< as the paper's table says
  double refusion_m, static_fusion_m, dynaslam_g_m, dynaslam_ng_m, mask_fusion_m;
};

inline constexpr std::array<PaperRow, 6> kPaperTum = {{
    {"sitting_static", "sitting_static", 0.009, 0.014, 0.009, 0.007, 0.021},
    {"sitting_xyz", "sitting_xyz", 0.040, 0.039, 0.009, 0.015, 0.031},
    {"sitting_halfsphere", "sitting_halfsphere", 0.110, 0.041, 0.017, 0.028, 0.052},
    {"walking_static", "walking_static", 0.017, 0.015, 0.014, 0.007, 0.035},
    {"walking_xyz", "walking_xyz", 0.099, 0.093, 0.085, 0.017, 0.104},
    {"walking_halfsphere", "walking_halfsphere", 0.104, 0.681, 0.084, 0.026, 0.106},
}};

inline constexpr std::array<PaperRow, 24> kPaperBonn = {{
    {"balloon", "balloon", 0.175, 0.233, 0.050, 0.030, kNotInPaper},
    {"balloon2", "balloon2", 0.254, 0.293, 0.142, 0.029, kNotInPaper},
    {"balloon_tracking", "balloon_tracking", 0.302, 0.221, 0.156, 0.049, kNotInPaper},
    {"balloon_tracking2", "balloon_tracking2", 0.322, 0.366, 0.192, 0.035, kNotInPaper},
    {"crowd", "crowd", 0.204, 3.586, 1.065, 0.016, kNotInPaper},
    {"crowd2", "crowd2", 0.155, 0.215, 1.217, 0.031, kNotInPaper},
    {"crowd3", "crowd3", 0.137, 0.168, 0.835, 0.038, kNotInPaper},
    {"kidnapping_box", "kidnapping_box", 0.148, 0.336, 0.026, 0.029, kNotInPaper},
    {"kidnapping_box2", "kidnapping_box2", 0.161, 0.263, 0.033, 0.035, kNotInPaper},
    {"moving_nonobstructing_box", "moving_no_box", 0.071, 0.141, 0.317, 0.232, kNotInPaper},
    {"moving_nonobstructing_box2", "moving_no_box2", 0.179, 0.364, 0.052, 0.039, kNotInPaper},
    {"moving_obstructing_box", "moving_o_box", 0.343, 0.331, 0.544, 0.044, kNotInPaper},
    {"moving_obstructing_box2", "moving_o_box2", 0.528, 0.309, 0.589, 0.263, kNotInPaper},
    {"person_tracking", "person_tracking", 0.289, 0.484, 0.714, 0.061, kNotInPaper},
    {"person_tracking2", "person_tracking2", 0.463, 0.626, 0.817, 0.078, kNotInPaper},
    {"placing_nonobstructing_box", "placing_no_box", 0.106, 0.125, 0.645, 0.575, kNotInPaper},
    {"placing_nonobstructing_box2", "placing_no_box2", 0.141, 0.177, 0.027, 0.021, kNotInPaper},
    {"placing_nonobstructing_box3", "placing_no_box3", 0.174, 0.256, 0.327, 0.058, kNotInPaper},
    {"placing_obstructing_box", "placing_o_box", 0.571, 0.330, 0.267, 0.255, kNotInPaper},
    {"removing_nonobstructing_box", "removing_no_box", 0.041, 0.136, 0.016, 0.016, kNotInPaper},
    {"removing_nonobstructing_box2", "removing_no_box2", 0.111, 0.129, 0.022, 0.021, kNotInPaper},
    {"removing_obstructing_box", "removing_o_box", 0.222, 0.334, 0.362, 0.291, kNotInPaper},
    {"synchronous", "synchronous", 0.441, 0.446, 0.977, 0.015, kNotInPaper},
    {"synchronous2", "synchronous2", 0.022, 0.027, 0.887, 0.009, kNotInPaper},
}};

}  // namespace stillmap
