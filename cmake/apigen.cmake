# The headers and the generator that reads them; the library, the Python package and the tests use it.
find_package(Python3 3.11 REQUIRED COMPONENTS Interpreter)
set(ULNA_HEADER_FOLDER ${PROJECT_SOURCE_DIR}/capi/include/ulna)
set(ULNA_APIGEN ${PROJECT_SOURCE_DIR}/capi/tools/apigen.py)
set(ULNA_APIGEN_SOURCES ${ULNA_APIGEN} ${PROJECT_SOURCE_DIR}/capi/tools/cheader.py)
file(GLOB ULNA_HEADERS CONFIGURE_DEPENDS ${ULNA_HEADER_FOLDER}/*.h)
set(ULNA_EXPORT_MAP ${PROJECT_BINARY_DIR}/generated/ulna.map)
set(ULNA_LAYOUT_SOURCE ${PROJECT_BINARY_DIR}/generated/ulna_layout.c)
