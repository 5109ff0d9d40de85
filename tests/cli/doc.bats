# SPDX-License-Identifier: GPL-2.0-or-later
# The reference of the public headers: complete, and refused where it would not be.

load cli

setup() {
	command -v doxygen >/dev/null || skip "doxygen is not installed"
	work_folder
}

@test "every public function, type and macro is in the reference, without a warning" {
	cd "$root"
	run -0 mk/doc "$BATS_TEST_TMPDIR/doc" 1.2.3
	[ -z "$output" ]
	html=$BATS_TEST_TMPDIR/doc/html
	grep -q '1\.2\.3' "$html/index.html"
	for header in lib/include/incise/*.h; do
		name=${header##*/}
		[ -f "$html/$(sed 's/_/__/g; s/\.h$/_8h.html/' <<<"$name")" ] || complain "$name has no page"
	done
	# an @name in a comment became a parameter, and a drawing is still one
	run ! grep -E '[( ]@(input|rule|mf|from|depth)' "$html/model_8h.html"
	grep -q 'class="fragment".*motor' "$html/stepper_8h.html"
}

# A tree with the files that mk/doc reads, and a header of our own.
tree_with() { # HEADER-TEXT
	mkdir -p lib/include/incise doc mk
	cp "$root/lib/include/incise/export.h" lib/include/incise/
	cp "$root"/doc/{Doxyfile,reference.*} doc/
	cp "$root/mk/doc" mk/
	printf '%s\n' 'global:' '	incise_more;' 'local:' >lib/libincise.map
	printf '%s\n' '/* SPDX-License-Identifier: LGPL-2.1-or-later */' '/*' ' * More.' ' */' \
		"$1" >lib/include/incise/more.h
}

@test "a function without a comment is refused" {
	tree_with 'int incise_more(int depth_mm);'
	run -1 mk/doc out 1
	[[ "$output" == *"incise_more"*"is not documented"* ]]
}

@test "a struct without a comment is refused, members of one with a comment are not" {
	tree_with '/** More. */
int incise_more(int depth_mm);
struct incise_most { int depth_mm; };'
	run -1 mk/doc out 1
	[[ "$output" == *"incise_most is not documented"* ]]
	sed -i 's|^struct|/** Most. */\n&|' lib/include/incise/more.h
	run -0 mk/doc out 1
	[ -z "$output" ]
}

@test "a parameter that there is not is refused" {
	tree_with '/** More. @param none of that name */
int incise_more(int depth_mm);'
	run -1 mk/doc out 1
	[[ "$output" == *"'none'"* ]]
}

@test "an export that is not in the reference is refused" {
	tree_with '/** Less. */
int incise_less(int depth_mm);'
	run -1 mk/doc out 1
	[[ "$output" == "incise_more: is exported and not in the reference" ]]
}
