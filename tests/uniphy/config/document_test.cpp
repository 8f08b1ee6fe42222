#include "uniphy/config/document.hpp"

#include <gtest/gtest.h>

#include "tests/uniphy/support/scratch.hpp"

namespace uniphy {
namespace {

TEST(Document, KeepsOrderLinesAndQuotes) {
  const auto root =
      parse_document("b: 1\na:\n  - x\n  - \"2\"\nc:\n  d: ~\n  e: |\n    text\n", "f");
  ASSERT_EQ(root->entries.size(), 3u);
  EXPECT_EQ(root->entries[0].first, "b");
  EXPECT_EQ(root->find("b")->origin, "f:1");
  const auto list = root->find("a");
  ASSERT_EQ(list->items.size(), 2u);
  EXPECT_FALSE(list->items[0]->quoted);
  EXPECT_TRUE(list->items[1]->quoted);
  EXPECT_EQ(list->items[1]->origin, "f:4");
  EXPECT_EQ(root->find("c")->find("d")->kind, Node::Kind::null);
  EXPECT_EQ(root->find("c")->find("e")->text, "text\n");
}

TEST(Document, EmptyTextIsAnEmptyMap) {
  for (const char* text : {"", "\n\n", "# only a comment\n", "---\n"}) {
    const auto root = parse_document(text, "f");
    EXPECT_EQ(root->kind, Node::Kind::map) << text;
    EXPECT_TRUE(root->entries.empty()) << text;
  }
}

TEST(Document, WindowsLineEndsAndByteOrderMarkPass) {
  const auto root = parse_document(
      "\xEF\xBB\xBF"
      "a: 1\r\nb: caf\xC3\xA9\r\n",
      "f");
  EXPECT_EQ(root->find("a")->text, "1");
  EXPECT_EQ(root->find("b")->text, "caf\xC3\xA9");
}

TEST(Document, EmittedTextReadsBackToTheSameTree) {
  const char* text =
      "empty: {}\nnone: null\nword: abc\nnumber_text: \"12\"\nlooks_null: \"null\"\n"
      "hard: \"a: b # c \\\"d\\\" \\\\ \\n e\"\ndash: \"-\"\nblank: \"\"\n"
      "list: [1, .inf, -2.5e-3, \"true\"]\nnested:\n  - name: a\n    inner:\n      - [1, 2]\n"
      "      - [3]\n  - name: b\n  - {}\n\"odd key\": 1\n";
  const auto once = parse_document(text, "f");
  const std::string emitted = emit_document(*once);
  const auto twice = parse_document(emitted, "f");
  EXPECT_EQ(emit_document(*twice), emitted);
  EXPECT_EQ(twice->find("hard")->text, "a: b # c \"d\" \\ \n e");
  EXPECT_TRUE(twice->find("number_text")->quoted);
  EXPECT_TRUE(twice->find("looks_null")->quoted);
  EXPECT_EQ(twice->find("none")->kind, Node::Kind::null);
  EXPECT_EQ(twice->find("nested")->items[0]->find("inner")->items[1]->items[0]->text, "3");
  EXPECT_EQ(twice->find("nested")->items[2]->kind, Node::Kind::map);
  EXPECT_EQ(twice->find("odd key")->text, "1");
}

TEST(Document, EmittedTextEscapesWhatReadersOfYamlStumbleOver) {
  // Next line, line and paragraph separators, a byte order mark, a control character, no character.
  const auto root = parse_document(
      "a: \"\\x01 \\x7F \\x85 \\u009F \\u2028 \\u2029 \\uFEFF \\uFFFE \\uFFFF\"\n"
      "b: \"\\xA0 \\u03BC \\U0001F600\"\n",
      "f");
  const std::string emitted = emit_document(*root);
  EXPECT_EQ(emitted,
            "a: \"\\u0001 \\u007F \\u0085 \\u009F \\u2028 \\u2029 \\uFEFF \\uFFFE \\uFFFF\"\n"
            "b: \"\xC2\xA0 \xCE\xBC \xF0\x9F\x98\x80\"\n");
  const auto again = parse_document(emitted, "f");
  EXPECT_EQ(again->find("a")->text, root->find("a")->text);
  EXPECT_EQ(again->find("b")->text, root->find("b")->text);
}

TEST(Override, SetsReplacesAndAppends) {
  const auto root = parse_document("scene: {grid: 20}\nbodies:\n  - density: 1\n", "f");
  apply_override(*root, "scene.grid=32");
  apply_override(*root, "scene.gravity=[0, -1, 0]");
  apply_override(*root, "bodies.0.density=500");
  apply_override(*root, "bodies.1.density=600");
  apply_override(*root, "new.deep.key={a: 1}");
  apply_override(*root, "text=a=b");
  EXPECT_TRUE(apply_override(*root, "gone=1"));
  EXPECT_TRUE(apply_override(*root, "gone="));
  EXPECT_EQ(root->find("scene")->find("grid")->text, "32");
  EXPECT_EQ(root->find("scene")->find("grid")->origin, "--set scene.grid=32");
  EXPECT_EQ(root->find("scene")->find("gravity")->items[1]->text, "-1");
  EXPECT_EQ(root->find("bodies")->items[0]->find("density")->text, "500");
  EXPECT_EQ(root->find("bodies")->items[1]->find("density")->text, "600");
  EXPECT_EQ(root->find("new")->find("deep")->find("key")->find("a")->text, "1");
  EXPECT_EQ(root->find("text")->text, "a=b");
  EXPECT_EQ(root->find("gone"), nullptr);
}

TEST(Override, TakesBackKeysMapsAndEntries) {
  const auto root = parse_document(
      "scene: {grid: 20, dt: 1}\nresume: {file: x}\nlist: [1, 2, 3]\nempty:\nnone: []\n"
      "bodies:\n  - density: 1\n  - {density: 2, law: {mu: 3}}\n  - density: 3\n",
      "f");
  EXPECT_TRUE(apply_override(*root, "scene.grid=null"));
  EXPECT_TRUE(apply_override(*root, "resume=~"));
  EXPECT_TRUE(apply_override(*root, "list.0=null"));
  EXPECT_TRUE(apply_override(*root, "bodies.1.law.mu="));
  EXPECT_TRUE(apply_override(*root, "bodies.0=null"));
  EXPECT_TRUE(apply_override(*root, "bodies.1=null"));  // of the two that are left
  EXPECT_EQ(emit_document(*root),
            "scene:\n  dt: 1\nlist: [2, 3]\nempty: null\nnone: []\nbodies:\n"
            "  - density: 2\n    law: {}\n");
  // What is not there is not made on the way either.
  const std::string before = emit_document(*root);
  for (const char* path : {"scene.grid", "resume.file", "resume.deep.key", "empty.key", "new"})
    EXPECT_FALSE(apply_override(*root, path + std::string("=null"))) << path;
  EXPECT_EQ(emit_document(*root), before);
  EXPECT_EQ(testing::error_of([&] { apply_override(*root, "bodies.1=null"); }),
            "--set bodies.1=null: bodies: expected an index from 0 to 0 of a list, found \"1\"");
  EXPECT_EQ(testing::error_of([&] { apply_override(*root, "bodies.1.density=null"); }),
            "--set bodies.1.density=null: bodies: expected an index from 0 to 0 of a list, found "
            "\"1\"");
  EXPECT_EQ(testing::error_of([&] { apply_override(*root, "none.0=null"); }),
            "--set none.0=null: none: expected a list with entries, found an empty one");
  EXPECT_EQ(testing::error_of([&] { apply_override(*root, "scene.dt.x=null"); }),
            "--set scene.dt.x=null: scene.dt: expected a map or a list, found \"1\"");
}

TEST(Document, HostileDocumentsAreRefused) {
  // Unfolded they would outlast the time limit of the tests.
  std::string laughs = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n";
  for (int i = 1; i < 12; ++i) {
    laughs += "a" + std::to_string(i) + ": &a" + std::to_string(i) + " [*a, *a, *a]\n";
  }
  EXPECT_NE(testing::error_of([&] { parse_document(laughs, "f"); }).find("f:1: YAML anchors"),
            std::string::npos);
  for (const char* opening : {"[", "{a: ", "- ", "? ", "a: [", "!!x "}) {
    std::string deep;
    while (deep.size() < kMaximumBytes / 2) deep += opening;
    EXPECT_FALSE(testing::error_of([&] { parse_document(deep, "f"); }).empty());
  }
  std::string wide = "a: [";
  while (wide.size() < kMaximumBytes - 10) wide += "1,";
  EXPECT_NE(testing::error_of([&] {
              parse_document(wide + "1]", "f");
            }).find("expected at most 100000 values"),
            std::string::npos);
}

}  // namespace
}  // namespace uniphy
