// The depth pre-pass: it writes no colour. With it every pixel is decoded once, whatever lies behind it (the thesis's removal of hidden
// fragments, 7.3.4), because the colour pass meets only fragments that are the nearest. `lf_cover` comes before it: where a mask has a
// hole, there is nothing.

void main() {
#ifdef LF_COVER
	lfOpacity();
#endif
}
