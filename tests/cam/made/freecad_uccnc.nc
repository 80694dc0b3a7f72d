%prog1
(PathScripts.post.uccnc_post --no-show-editor)
(Exported by FreeCAD for UC-CNC)
(Post Processor: PathScripts.post.uccnc_post, version 0.0.4)
(CAM file: )
(Output Time: 2026-11-24 14:48:15.423832)
(Units: 'mm' and 'mm/min')
(preamble: begin)
G17 (Default: XY-plane)
G54 (Default: First coordinate system)
G40 (Default: Cutter radius compensation none)
G49 (Default: Tool Length Offsets: cancel tool length)
G90 (Default: Absolute distance mode selection)
G80 (Cancel canned cycle)
(preamble: done)
(operation initialise: TC: Default Tool)
(operation start: TC: Default Tool)
(TC: Default Tool)
M6 T1
M3 S9000
(operation done: TC: Default Tool)
(operation finalised: TC: Default Tool)
(operation initialise: Profile)
(operation start: Profile)
(Profile)
(Compensated Tool Path. Diameter: 5.0)
G0 Z14.000
G0 X40.301 Y30.302
G0 Z12.000
G1 Y30.302 Z4.000 F120.000
G2 X42.495 Y25.151 I-5.306 J-5.304 K0.000 F600.000
G1 X42.500 Y5.000
G2 X35.151 Y-2.495 I-7.502 J0.005
G1 X5.000 Y-2.500
G2 X-2.495 Y4.849 I0.005 J7.502
G1 X-2.500 Y25.000
G2 X4.849 Y32.495 I7.502 J-0.005
G1 X35.000 Y32.500
G2 X40.301 Y30.302 I-0.005 J-7.502
G1 Z-1.000 F120.000
G2 X42.495 Y25.151 I-5.306 J-5.304 F600.000
G1 X42.500 Y5.000
G2 X35.151 Y-2.495 I-7.502 J0.005
G1 X5.000 Y-2.500
G2 X-2.495 Y4.849 I0.005 J7.502
G1 X-2.500 Y25.000
G2 X4.849 Y32.495 I7.502 J-0.005
G1 X35.000 Y32.500
G2 X40.301 Y30.302 I-0.005 J-7.502
G0 Z14.000
G0
(operation done: Profile)
(operation finalised: Profile)
(operation initialise: Drill)
(operation start: Drill)
(Drill)
G0 Z14.000
(operation done: Drill)
(operation finalised: Drill)
(postamble: begin)
M05 (stop spindle)
G17 (Default: XY-plane)
G54 (Default: First coordinate system)
G40 (Default: Cutter radius compensation none)
G90 (Default: Absolute distance mode selection)
G80 (Cancel canned cycle)
M30 (Stop program and rewind code)
(postamble: done)
