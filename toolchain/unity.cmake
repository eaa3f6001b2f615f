# stillmap_unity(TARGET): sources that share heavy headers (GoogleTest, CLI11, JSON, Eigen) compile several at a time, each header
# read and each template made once: a third of the time. What two of a target's sources both keep in an unnamed
# namespace then needs different names.
function(stillmap_unity target)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${STILLMAP_UNITY} UNITY_BUILD_BATCH_SIZE 8)
endfunction()
