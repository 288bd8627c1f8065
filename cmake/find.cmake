# ulna_find(<library>) finds a library that one module needs, and names the Debian package when it is
# not there. A module asks only for what it uses.
list(PREPEND CMAKE_MODULE_PATH ${CMAKE_CURRENT_LIST_DIR})
set(ULNA_PACKAGE_Eigen3 libeigen3-dev)
set(ULNA_PACKAGE_NLopt libnlopt-dev)
set(ULNA_PACKAGE_MuJoCo libmujoco-dev)
set(ULNA_PACKAGE_tinyxml2 libtinyxml2-dev)
set(ULNA_PACKAGE_IPOPT coinor-libipopt-dev)
set(ULNA_PACKAGE_OpenCV libopencv-dev)
set(ULNA_PACKAGE_GTest libgtest-dev)
set(ULNA_PACKAGE_benchmark libbenchmark-dev)

macro(ulna_find library)
  find_package(${library} ${ARGN} QUIET)
  if(NOT ${library}_FOUND)
    message(FATAL_ERROR
      "${library} is not there. On Debian: apt-get install ${ULNA_PACKAGE_${library}}")
  endif()
endmacro()
