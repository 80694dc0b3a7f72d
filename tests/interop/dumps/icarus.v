`timescale 1ps/1ps
module board;
  reg x_step, x_dir;
  reg [31:0] done;
  integer k;
  initial begin
    $dumpfile("icarus.vcd");
    $dumpvars(0, board);
    done = 0;
    #1000000 x_dir = 1;
    for (k = 0; k < 5; k = k + 1) begin
      #5000000 x_step = 1; done = done + 1;
      #5000000 x_step = 0;
    end
    x_dir = 0;
    $dumpoff;
    for (k = 0; k < 3; k = k + 1) begin
      #5000000 x_step = 1; done = done + 1;
      #5000000 x_step = 0;
    end
    $dumpon;
    for (k = 0; k < 2; k = k + 1) begin
      #5000000 x_step = 1; done = done + 1;
      #5000000 x_step = 0;
    end
    #5000000 $finish;
  end
endmodule
