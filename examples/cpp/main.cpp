// Develops mosaics with a portable camera. See README.md beside this file, or run it without arguments.
#include "camkit_portable.hpp"

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <iostream>

namespace {

constexpr char usage[] = R"(usage: camkit_develop CAMERA [OPTIONS] MOSAIC PICTURE [MOSAIC PICTURE ...]

CAMERA   folder that `camkit portable` wrote
MOSAIC   samples in DN as .npy (uint16, C order), or raw uint16 in little endian with --size-px
PICTURE  .pfm (float32, linear Rec.709) or .ppm (16 bit, sRGB)

  --iso ISO               of the captures; default: 100
  --white-balance R,G,B   gains; default: 1,1,1
  --origin-px X,Y         of the first sample on the sensor; default: 0,0
  --levels BLACK,WHITE    in DN; default: the sensor's
  --size-px W,H           of raw mosaics
  --size S                of the network; default: M
  --threads N             of a graph; default: 1
  --straight no           stop before the distortion is taken out: the camera's colours
)";

struct Mosaic {
  int width = 0, height = 0;
  std::vector<std::uint16_t> samples;
};

std::vector<double> numbers(const std::string& text, std::size_t count, const std::string& option) {
  std::istringstream in(text);
  in.imbue(std::locale::classic());
  std::vector<double> all;
  char comma = ',';
  for (double one = 0; comma == ',' && in >> one;) {
    all.push_back(one);
    if (!(in >> comma)) break;
  }
  if (all.size() != count || !in.eof()) throw camkit::Error(option + " takes " + std::to_string(count) + " numbers; got " + text);
  return all;
}

Mosaic read_mosaic(const std::string& path, int width, int height) {
  const std::string data = camkit::detail::read_file(path);
  std::size_t start = 0;
  if (data.compare(0, 6, "\x93NUMPY") == 0 && data.size() > 12) {
    const auto byte = [&data](std::size_t i) { return std::size_t(std::uint8_t(data[i])); };
    start = data[6] == 1 ? 10 + byte(8) + 256 * byte(9) : 12 + byte(8) + 256 * byte(9) + 65536 * byte(10);
    const std::string head = data.substr(0, start);
    const auto shape = head.find("'shape': (");
    const bool plain = head.find("'<u2'") != head.npos && head.find("'fortran_order': False") != head.npos;
    if (!plain || shape == head.npos || std::sscanf(head.c_str() + shape, "'shape': (%d, %d)", &height, &width) != 2)
      throw camkit::Error(path + " is no array of uint16 with two axes in C order");
  }
  if (width <= 0 || height <= 0) throw camkit::Error(path + " is raw: give its --size-px W,H");
  Mosaic mosaic{width, height, std::vector<std::uint16_t>(std::size_t(width) * std::size_t(height))};
  if (data.size() != start + 2 * mosaic.samples.size())
    throw camkit::Error(path + " holds " + std::to_string(data.size() - std::min(start, data.size())) + " bytes of samples, not " +
                        std::to_string(2 * mosaic.samples.size()));
  for (std::size_t i = 0; i < mosaic.samples.size(); ++i)
    mosaic.samples[i] = std::uint16_t(std::uint8_t(data[start + 2 * i]) | std::uint8_t(data[start + 2 * i + 1]) << 8);
  return mosaic;
}

double to_srgb(double light) {
  light = std::clamp(light, 0.0, 1.0);
  return light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055;
}

void write_picture(const std::string& path, const camkit::Picture& picture) {
  const bool is_pfm = path.size() > 4 && path.compare(path.size() - 4, 4, ".pfm") == 0;
  std::ostringstream head;
  head << (is_pfm ? "PF\n" : "P6\n") << picture.width << ' ' << picture.height << (is_pfm ? "\n-1.0\n" : "\n65535\n");
  std::string data = head.str();
  for (int i = 0; i < picture.height; ++i)
    for (int x = 0; x < picture.width; ++x)
      for (int c = 0; c < 3; ++c) {
        const float light = picture.row(c, is_pfm ? picture.height - 1 - i : i)[x];  // PFM: from the bottom
        std::uint32_t bits = 0;
        if (is_pfm) {
          std::memcpy(&bits, &light, 4);
          for (int k = 0; k < 4; ++k) data += char(bits >> (8 * k));
        } else {
          bits = std::uint32_t(std::lround(65535 * to_srgb(light)));
          data += char(bits >> 8), data += char(bits);
        }
      }
  std::ofstream file(path, std::ios::binary);
  file.write(data.data(), std::streamsize(data.size())).flush();
  if (!file) throw camkit::Error("cannot write " + path);
}

void develop(const std::vector<std::string>& words) {
  camkit::Capture capture;
  camkit::Options options;
  bool straight = true;
  int width = 0, height = 0;
  std::vector<std::string> files;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string& option = words[i];
    if (option.compare(0, 2, "--") != 0) {
      files.push_back(option);
      continue;
    }
    if (++i == words.size()) throw camkit::Error(option + " needs a value");
    const auto take = [&](std::size_t count) { return numbers(words[i], count, option); };
    if (option == "--iso") {
      capture.iso = take(1)[0];
    } else if (option == "--white-balance") {
      const auto gains = take(3);
      std::transform(gains.begin(), gains.end(), capture.white_balance.begin(), [](double gain) { return float(gain); });
    } else if (option == "--origin-px") {
      capture.origin_px = {int(take(2)[0]), int(take(2)[1])};
    } else if (option == "--levels") {
      capture.levels = {{take(2)[0], take(2)[1]}};
    } else if (option == "--size-px") {
      width = int(take(2)[0]), height = int(take(2)[1]);
    } else if (option == "--size") {
      options.size = words[i];
    } else if (option == "--threads") {
      options.threads = int(take(1)[0]);
    } else if (option == "--straight" && (words[i] == "no" || words[i] == "yes")) {
      straight = words[i] == "yes";
    } else {
      throw camkit::Error("unknown option " + option + " " + words[i]);
    }
  }
  if (files.size() < 3 || files.size() % 2 == 0) throw camkit::Error("a camera and pairs of files are needed\n\n" + std::string(usage));
  const camkit::Camera camera(files[0], options);
  for (std::size_t i = 1; i < files.size(); i += 2) {
    const Mosaic mosaic = read_mosaic(files[i], width, height);
    capture.samples = mosaic.samples.data(), capture.width = mosaic.width, capture.height = mosaic.height;
    const std::clock_t start = std::clock();
    const camkit::Picture picture = camera.develop(capture, straight);
    const double seconds = double(std::clock() - start) / CLOCKS_PER_SEC;
    write_picture(files[i + 1], picture);
    std::cout << files[i + 1] << ": " << mosaic.width << "x" << mosaic.height << ", " << seconds << " CPU s\n";
  }
}

}  // namespace

int main(int count, char** words) try {
#ifdef _WIN32
  _putenv_s("ORT_DISABLE_TELEMETRY", "1");
#else
  setenv("ORT_DISABLE_TELEMETRY", "1", 0);
#endif
  develop({words + 1, words + count});
  return 0;
} catch (const std::exception& error) {
  std::cerr << "camkit_develop: " << error.what() << "\n";
  return 1;
}
