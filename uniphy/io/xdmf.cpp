#include <fmt/format.h>

#include "uniphy/io/markup.hpp"
#include "uniphy/io/trajectory.hpp"

namespace uniphy {
namespace {

/// A whole dataset of the file.
std::string data_item(const std::string& h5, const std::string& name, const std::string& dimensions,
                      const char* number) {
  return fmt::format("<DataItem Dimensions=\"{}\" {} Format=\"HDF\">{}:/{}</DataItem>\n",
                     dimensions, number, h5, name);
}

constexpr const char* kReal = "NumberType=\"Float\" Precision=\"8\"";
constexpr const char* kInteger = "NumberType=\"Int\" Precision=\"4\"";

}  // namespace

std::string xdmf_view(std::size_t frame, const std::string& field) {
  return fmt::format("xdmf/{}/{}", frame, field);
}

std::string xdmf_text(const std::string& h5_name, std::int64_t particles,
                      const std::vector<double>& times, FrameFields fields) {
  const std::string h5 = markup_escaped(h5_name);
  const std::string count = std::to_string(particles);
  const auto attribute = [](const char* name, const char* type, const std::string& item) {
    return fmt::format(
        "        <Attribute Name=\"{}\" AttributeType=\"{}\" Center=\"Node\">\n"
        "          {}"
        "        </Attribute>\n",
        name, type, item);
  };
  std::string out =
      "<?xml version=\"1.0\" ?>\n"
      "<Xdmf Version=\"3.0\">\n"
      "  <Domain>\n"
      "    <Grid Name=\"trajectory\" GridType=\"Collection\" CollectionType=\"Temporal\">\n";
  for (std::size_t frame = 0; frame < times.size(); ++frame) {
    const auto view = [&](const char* name, const std::string& row) {
      return data_item(h5, xdmf_view(frame, name), count + row, kReal);
    };
    out += fmt::format(
        "      <Grid Name=\"particles\" GridType=\"Uniform\">\n"
        "        <Time Value=\"{}\" />\n"
        "        <Topology TopologyType=\"Polyvertex\" NumberOfElements=\"{}\" "
        "NodesPerElement=\"1\">\n"
        "          {}"
        "        </Topology>\n"
        "        <Geometry GeometryType=\"XYZ\">\n"
        "          {}"
        "        </Geometry>\n",
        times[frame], count, data_item(h5, kXdmfVertices, count, kInteger), view("x", " 3"));
    if (fields.v) out += attribute("v", "Vector", view("v", " 3"));
    if (fields.C) out += attribute("C", "Tensor", view("C", " 3 3"));
    if (fields.F) out += attribute("F", "Tensor", view("F", " 3 3"));
    out += attribute("body", "Scalar", data_item(h5, "body", count, kInteger));
    out += attribute("mass", "Scalar", data_item(h5, "mass", count, kReal));
    out += "      </Grid>\n";
  }
  return out + "    </Grid>\n  </Domain>\n</Xdmf>\n";
}

}  // namespace uniphy
