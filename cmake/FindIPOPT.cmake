# IPOPT: IPOPT::ipopt. Debian keeps its headers in include/coin.
find_path(IPOPT_INCLUDE_DIR IpStdCInterface.h PATH_SUFFIXES coin coin-or)
find_library(IPOPT_LIBRARY NAMES ipopt)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(IPOPT REQUIRED_VARS IPOPT_LIBRARY IPOPT_INCLUDE_DIR)
if(IPOPT_FOUND AND NOT TARGET IPOPT::ipopt)
  add_library(IPOPT::ipopt UNKNOWN IMPORTED)
  set_target_properties(IPOPT::ipopt PROPERTIES IMPORTED_LOCATION ${IPOPT_LIBRARY}
    INTERFACE_INCLUDE_DIRECTORIES ${IPOPT_INCLUDE_DIR})
endif()
mark_as_advanced(IPOPT_INCLUDE_DIR IPOPT_LIBRARY)
