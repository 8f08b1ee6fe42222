#include <fmt/format.h>

#include "uniphy/io/trajectory.hpp"

namespace uniphy {
namespace {

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

/// Frame `frame` of a dataset [frames, particles, components...].
std::string frame_item(const std::string& h5, const char* name, std::size_t frame,
                       std::size_t frames, std::int64_t particles, const std::string& row) {
  const bool tensor = row == "3 3";
  const std::string zeros = tensor ? "0 0 0" : "0 0";
  const std::string ones = tensor ? "1 1 1 1" : "1 1 1";
  return fmt::format(
      "          <DataItem ItemType=\"HyperSlab\" Dimensions=\"{2} {3}\">\n"
      "            <DataItem Dimensions=\"3 {4}\" Format=\"XML\">{5} {6} {7} 1 {2} {8}</DataItem>\n"
      "            <DataItem Dimensions=\"{9} {2} {8}\" NumberType=\"Float\" Precision=\"8\" "
      "Format=\"HDF\">{0}:/{1}</DataItem>\n"
      "          </DataItem>\n",
      h5, name, particles, tensor ? "9" : "3", tensor ? 4 : 3, frame, zeros, ones, row, frames);
}

std::string particle_item(const std::string& h5, const char* name, std::int64_t particles,
                          const char* number) {
  return fmt::format(
      "        <Attribute Name=\"{1}\" AttributeType=\"Scalar\" Center=\"Node\">\n"
      "          <DataItem Dimensions=\"{2}\" {3} Format=\"HDF\">{0}:/{1}</DataItem>\n"
      "        </Attribute>\n",
      h5, name, particles, number);
}

}  // namespace

std::string xdmf_text(const std::string& h5_name, std::int64_t particles,
                      const std::vector<double>& times, FrameFields fields) {
  const std::string h5 = escaped(h5_name);
  std::string out =
      "<?xml version=\"1.0\" ?>\n"
      "<Xdmf Version=\"3.0\">\n"
      "  <Domain>\n"
      "    <Grid Name=\"trajectory\" GridType=\"Collection\" CollectionType=\"Temporal\">\n";
  for (std::size_t frame = 0; frame < times.size(); ++frame) {
    const auto item = [&](const char* name, const std::string& row) {
      return frame_item(h5, name, frame, times.size(), particles, row);
    };
    const auto attribute = [&](const char* name, const char* type, const std::string& row) {
      return fmt::format(
          "        <Attribute Name=\"{}\" AttributeType=\"{}\" Center=\"Node\">\n{}"
          "        </Attribute>\n",
          name, type, item(name, row));
    };
    out += fmt::format(
        "      <Grid Name=\"particles\" GridType=\"Uniform\">\n"
        "        <Time Value=\"{}\" />\n"
        "        <Topology TopologyType=\"Polyvertex\" NumberOfElements=\"{}\" "
        "NodesPerElement=\"1\" />\n"
        "        <Geometry GeometryType=\"XYZ\">\n{}        </Geometry>\n",
        times[frame], particles, item("x", "3"));
    if (fields.v) out += attribute("v", "Vector", "3");
    if (fields.C) out += attribute("C", "Tensor", "3 3");
    if (fields.F) out += attribute("F", "Tensor", "3 3");
    out += particle_item(h5, "body", particles, "NumberType=\"Int\" Precision=\"4\"");
    out += particle_item(h5, "mass", particles, "NumberType=\"Float\" Precision=\"8\"");
    out += "      </Grid>\n";
  }
  return out + "    </Grid>\n  </Domain>\n</Xdmf>\n";
}

}  // namespace uniphy
